#include "exchange/printing/marker_mount.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <map>
#include <numbers>
#include <set>

#include "apps/markers.h"
#include "core/config.h"
#include "core/file.h"
#include "scene/meshes/mesh.h"
#include "tests/support/matchers.h"

namespace limn::exchange {
namespace {

namespace fs = std::filesystem;

using Triangle = std::array<Eigen::Vector3f, 3>;

struct Printed {
  std::vector<Triangle> triangles;       // mm
  std::vector<Eigen::Vector3f> normals;  // as written in the file
  Config json;
  fs::path stl;
};

// Reads what `limn markers --mount` wrote, byte by byte.
Printed printed(double size_mm) {
  apps::MarkersOptions options;
  options.size_mm = size_mm;
  options.mount = test::test_folder() / fmt::format("holder-{:g}.stl", size_mm);
  const Status status = apps::run_markers(options);
  EXPECT_TRUE(status) << status.message();
  Printed found;
  found.stl = options.mount;
  found.json = Config::load(fs::path(options.mount).replace_extension(".json"), "limn.mount/1").value();
  const std::string bytes = read_file(options.mount).value();
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  EXPECT_EQ(bytes.size(), 84 + 50 * std::size_t{count});
  for (std::size_t i = 0; i < count; ++i) {
    std::array<float, 12> values{};
    std::memcpy(values.data(), bytes.data() + 84 + 50 * i, sizeof(values));
    const auto vector = [&](std::size_t at) {
      return Eigen::Vector3f(values[at], values[at + 1], values[at + 2]);
    };
    found.normals.push_back(vector(0));
    found.triangles.push_back({vector(3), vector(6), vector(9)});
  }
  return found;
}

class Sizes : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(MarkerMount, Sizes, testing::Values(3.0, 10.0, 24.0, 40.0, 83.5, 152.0));

TEST_P(Sizes, IsOneClosedSurfaceThatFacesOutwards) {
  const Printed mount = printed(GetParam());
  using Key = std::array<float, 3>;
  const auto key = [](const Eigen::Vector3f& p) { return Key{p.x(), p.y(), p.z()}; };
  std::map<std::pair<Key, Key>, int> edges;
  std::set<Key> points;
  double volume = 0;
  for (std::size_t t = 0; t < mount.triangles.size(); ++t) {
    const auto& [a, b, c] = mount.triangles[t];
    const Eigen::Vector3f across = (b - a).cross(c - a);
    EXPECT_GT(across.norm(), 1e-3f) << "degenerate triangle " << t;
    EXPECT_GT(across.normalized().dot(mount.normals[t]), 0.9999f);
    volume += static_cast<double>(a.dot(b.cross(c))) / 6;
    for (int i = 0; i < 3; ++i) {
      const Triangle& corners = mount.triangles[t];
      points.insert(key(corners[static_cast<std::size_t>(i)]));
      ++edges[{key(corners[static_cast<std::size_t>(i)]),
               key(corners[static_cast<std::size_t>((i + 1) % 3)])}];
    }
  }
  for (const auto& [edge, times] : edges) {
    EXPECT_EQ(times, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u) << "an edge has a triangle on one side only";
  }
  // Euler: V - E + F = 2 for a closed surface without holes.
  EXPECT_EQ(static_cast<int>(points.size()) - static_cast<int>(edges.size()) / 2 +
                static_cast<int>(mount.triangles.size()),
            2);
  const ConfigNode root = mount.json.root();
  const double side = root.at("side_mm").number(), plate = root.at("plate_mm").number();
  const double bore = root.at("socket_mm").number() / 2, depth = root.at("socket_depth_mm").number();
  const double without = side * side * plate - std::numbers::pi * bore * bore * (depth + bore / 3);
  EXPECT_NEAR(volume, without, 0.05 * without);  // `without` ignores chamfer and guides
}

TEST_P(Sizes, PrintsWithoutSupports) {
  const Printed mount = printed(GetParam());
  for (std::size_t t = 0; t < mount.triangles.size(); ++t) {
    const auto& [a, b, c] = mount.triangles[t];
    const bool on_bed = a.z() == 0 && b.z() == 0 && c.z() == 0;
    if (!on_bed) {
      EXPECT_GE((b - a).cross(c - a).normalized().z(), -std::sqrt(0.5f) - 1e-4f) << t;
    }
  }
}

TEST_P(Sizes, HoldsTheMarkerWhereItSaysAndInSight) {
  const Printed mount = printed(GetParam());
  const ConfigNode root = mount.json.root();
  const double half = GetParam() / 2, paper = root.at("paper_side_mm").number() / 2;
  const Pose holder_from_marker = root.at("holder_from_marker").pose();
  // The face under the paper is flat, complete, and behind the marker's plane by the paper's thickness.
  const double face = 1000 * holder_from_marker.translation.z() - root.at("paper_mm").number();
  double area = 0;
  for (const auto& [a, b, c] : mount.triangles) {
    if (std::abs(a.z() - face) < 1e-4 && std::abs(b.z() - face) < 1e-4 && std::abs(c.z() - face) < 1e-4)
      area += static_cast<double>((b - a).cross(c - a).norm()) / 2;
  }
  EXPECT_GE(area, 4 * paper * paper);
  EXPECT_NEAR(area, 4 * paper * paper, 8 * paper * 3);
  // The marker's corners: x right, y down, z into the holder; a camera 75 degrees off sees each of them over
  // the guides.
  EXPECT_TRUE(test::near(holder_from_marker * Eigen::Vector3d(0.01, 0, 0) - holder_from_marker.translation,
                         Eigen::Vector3d(0.01, 0, 0), 1e-12));
  EXPECT_TRUE(test::near(holder_from_marker * Eigen::Vector3d(0, 0.01, 0) - holder_from_marker.translation,
                         Eigen::Vector3d(0, -0.01, 0), 1e-12));
  const double steep = std::tan(75 * std::numbers::pi / 180);
  for (const Triangle& triangle : mount.triangles) {
    for (const Eigen::Vector3f& p : triangle) {
      const double beyond = std::max(std::abs(p.x()), std::abs(p.y())) - half;
      const double above = p.z() - face;
      if (above > 1e-4) {
        EXPECT_GT(beyond, paper - half);          // guides are outside the paper
        EXPECT_LT(above * steep, 0.51 * beyond);  // and low enough
        EXPECT_GE(above, 0.19);                   // at least one layer of a printer
      }
    }
  }
}

TEST(MarkerMount, IsReadBackAsAMesh) {
  const Printed mount = printed(40);
  const auto mesh = scene::load_mesh(mount.stl, scene::LengthUnit::millimetre);
  ASSERT_TRUE(mesh) << mesh.message();
  EXPECT_EQ(mesh->triangles.size(), mount.triangles.size());
  Eigen::Vector3f least = mesh->positions[0], most = least;
  for (const Eigen::Vector3f& p : mesh->positions) {
    least = least.cwiseMin(p);
    most = most.cwiseMax(p);
  }
  // The marker is 40 mm, its white margins 5 mm, play and guides 2.15 mm; the bore 6.2 + cone 3.1 + 1.2, the
  // guides 0.6.
  EXPECT_TRUE(test::near(most.cast<double>(), Eigen::Vector3d(0.02715, 0.02715, 0.0111), 1e-6));
  EXPECT_TRUE(test::near(least.cast<double>(), Eigen::Vector3d(-0.02715, -0.02715, 0), 1e-6));
  EXPECT_TRUE(test::pose_near(mount.json.root().at("holder_from_marker").pose(),
                              Pose(Eigen::Quaterniond(0, 1, 0, 0), {0, 0, 0.0106}), 1e-9, 1e-9));
}

TEST(MarkerMount, WritesASheetBesideAndTellsWrongUsage) {
  apps::MarkersOptions good;
  const fs::path folder = test::test_folder();
  good.mount = folder / "a.stl";
  good.out = folder / "a.pdf";
  ASSERT_TRUE(apps::run_markers(good));
  EXPECT_TRUE(fs::exists(good.out));
  const auto is_wrong = [](apps::MarkersOptions options, const std::string& what) {
    const Status status = apps::run_markers(options);
    return !status && status.error().wrong_usage && status.message().find(what) != std::string::npos;
  };
  apps::MarkersOptions bad = good;
  bad.size_mm = 200;
  EXPECT_TRUE(is_wrong(bad, "--size-mm"));
  bad = good;
  bad.paper_mm = -1;
  EXPECT_TRUE(is_wrong(bad, "--paper-mm"));
  bad = good;
  bad.mount = "a.obj";
  EXPECT_TRUE(is_wrong(bad, "--mount"));
  bad = good;
  bad.board = "charuco:11x8:25mm";
  EXPECT_TRUE(is_wrong(bad, "--board"));
}

}  // namespace
}  // namespace limn::exchange
