#include "scene/meshes/scan_surface.h"

#include <gtest/gtest.h>

#include <random>

#include "core/file.h"
#include "scene/meshes/mesh_bvh.h"
#include "sim/car_door.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

ScanSurface two_triangles() {
  ScanSurface surface;
  surface.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 0, 0}, {7, 0, 0}, {5, 2, 0}};
  surface.normals.assign(6, {0, 0, 1});
  surface.stddevs = {1e-4f, 2e-4f, 3e-4f, 1e-4f, 1e-4f, 1e-4f};
  surface.colours_rgb.assign(6, {10, 200, 30});
  surface.triangles = {{0, 1, 2}, {3, 4, 5}};
  return surface;
}

TEST(Ply, WhatIsSavedIsReadBackAsIs) {
  const fs::path path = test::test_folder() / "a.ply";
  const ScanSurface surface = two_triangles();
  ASSERT_TRUE(save_ply(surface, path).ok());
  const auto read = load_ply(path);
  ASSERT_TRUE(read.ok()) << read.message();
  EXPECT_EQ(read->positions, surface.positions);
  EXPECT_EQ(read->normals, surface.normals);
  EXPECT_EQ(read->stddevs, surface.stddevs);
  EXPECT_EQ(read->colours_rgb, surface.colours_rgb);
  EXPECT_EQ(read->triangles, surface.triangles);
  EXPECT_EQ(load_ply(path, 0.001)->positions[3], Eigen::Vector3f(0.005f, 0, 0));
}

TEST(Ply, OtherProgramsFilesAreRead) {
  const fs::path path = test::test_folder() / "a.ply";
  ASSERT_TRUE(
      write_file(
          path,
          "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty double x\nproperty "
          "double y\nproperty double z\nproperty uchar quality\nelement face 1\nproperty list uchar uint "
          "vertex_index\nend_header\n0 0 0 7\n2 0 0 7\n2 2 0 7\n0 2 0 7\n4 0 1 2 3\n")
          .ok());
  const auto read = load_ply(path);
  ASSERT_TRUE(read.ok()) << read.message();
  EXPECT_EQ(read->triangles.size(), 2U);  // the square becomes a triangle fan
  EXPECT_EQ(read->normals[1], Eigen::Vector3f(0, 0, 1));
}

TEST(Ply, SaysWhatIsWrongWithAFile) {
  const fs::path folder = test::test_folder(), path = folder / "a.ply";
  const auto message = [&](const std::string& content) {
    EXPECT_TRUE(write_file(path, content).ok());
    const auto read = load_ply(path);
    return read ? std::string("read") : read.message();
  };
  ASSERT_TRUE(save_ply(two_triangles(), path).ok());
  const std::string whole = read_file(path).value();
  EXPECT_NE(message(whole.substr(0, whole.size() - 3)).find("truncated"), std::string::npos);
  EXPECT_NE(message("solid stl").find("expected a PLY"), std::string::npos);
  std::string beyond = whole;
  beyond[whole.size() - 4] = 17;  // the last face's last corner
  EXPECT_NE(message(beyond).find("beyond"), std::string::npos);
  const std::string head = "ply\nformat ascii 1.0\nelement vertex ";
  const std::string xyz = "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  EXPECT_NE(message(head + "0" + xyz).find("empty"), std::string::npos);
  EXPECT_NE(message(head + "1" + xyz + "0 nan 0\n").find("finite"), std::string::npos);
  EXPECT_NE(message(head + "1" + xyz + "0 0 0\n").find("neither"), std::string::npos);
}

TEST(ConnectedComponents, AreToldApartByTheirTrianglesTheLargestFirst) {
  const ScanSurface surface = two_triangles();
  const ConnectedComponents pieces = connected_components(surface);
  ASSERT_EQ(pieces.areas.size(), 2U);
  EXPECT_DOUBLE_EQ(pieces.areas[0], 2);
  EXPECT_EQ(pieces.of_vertex, (std::vector<int>{1, 1, 1, 0, 0, 0}));
  const ScanSurface first = with_vertices_kept(surface, {false, false, false, true, true, true});
  EXPECT_EQ(first.positions.size(), 3U);
  EXPECT_EQ(first.triangles, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}}));
}

TEST(MeshBvh, AnswersAsLookingAtEveryTriangleDoes) {
  auto rng = test::test_rng();
  std::uniform_real_distribution<double> anywhere(-0.4, 0.4);
  const Mesh mesh = sim::car_door_scene().prototype->mesh;
  const MeshBvh index(mesh);
  for (int i = 0; i < 60; ++i) {
    const Vector3d p(anywhere(rng), anywhere(rng), anywhere(rng));
    const MeshPoint expected = nearest_on(mesh, p);
    const auto found = index.nearest(p, 10);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->distance, expected.distance, 1e-12);
    EXPECT_TRUE(test::near(found->p, expected.p, 1e-9));
    EXPECT_FALSE(index.nearest(p, 0.99 * expected.distance));
  }
}

TEST(MeshBvh, DoesNotTakeABackForAFront) {
  auto rng = test::test_rng();
  std::uniform_real_distribution<double> inside(-0.15, 0.15);
  const Mesh mesh = sim::car_door_scene().prototype->mesh;
  const MeshBvh index(mesh);
  const auto face_z = [&](std::size_t t) {
    const auto& [i, j, k] = mesh.triangles[t];
    return (mesh.positions[j] - mesh.positions[i])
        .cross(mesh.positions[k] - mesh.positions[i])
        .normalized()
        .z();
  };
  for (int i = 0; i < 50; ++i) {
    const Vector3d p(inside(rng), inside(rng), -0.09),
        front(0, 0, 1);  // 5 mm before the back, 10 cm behind the front
    const auto any = index.nearest(p, 1), facing = index.nearest(p, 1, &front, 0.5);
    ASSERT_TRUE(any && facing);
    EXPECT_LT(face_z(any->triangle), 0);
    EXPECT_GT(face_z(facing->triangle), 0.5f);
    EXPECT_GT(facing->distance, any->distance);
  }
}

}  // namespace
}  // namespace limn::scene
