#include "sim/car_door.h"

#include <gtest/gtest.h>

#include <numbers>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "scene/meshes/mesh_bvh.h"
#include "sim/truth.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test;
namespace fs = std::filesystem;

const fs::path k_config = fs::path(LIMN_SOURCE_DIR) / "config";

Result<MarkerDrawing> plain_marker(const MarkerName&) {
  return MarkerDrawing{cv::Mat(6, 6, CV_8U, cv::Scalar(0))};
}

void expect_same_mesh(const scene::Mesh& found, const scene::Mesh& expected, const std::string& name) {
  ASSERT_EQ(found.positions.size(), expected.positions.size()) << name;
  ASSERT_EQ(found.triangles.size(), expected.triangles.size()) << name;
  for (std::size_t i = 0; i < found.positions.size(); ++i)
    ASSERT_LT((found.positions[i] - expected.positions[i]).norm(), 1e-6f) << name << ", vertex " << i;
}

// Shapes are compared to a micrometre, not bytes: another processor's sine differs in its last bit.
TEST(CarDoor, TheCommittedFilesAreWhatTheGeneratorMakes) {
  const auto files = sim::car_door_files();
  const fs::path made = test_folder();
  for (const auto& [name, content] : files) {
    EXPECT_LT(content.size(), 1000000U) << name;
    ASSERT_TRUE(write_file(made / name, content));
    const fs::path committed = k_config / "scenes" / "door" / name;
    ASSERT_TRUE(fs::exists(committed)) << name;
    if (committed.extension() != ".glb") continue;
    const auto found = scene::load_mesh(committed, scene::LengthUnit::metre),
               expected = scene::load_mesh(made / name, scene::LengthUnit::metre);
    ASSERT_TRUE(found && expected) << name;
    SCOPED_TRACE("after a change run limn_write_door config/scenes/door and commit");
    expect_same_mesh(*found, *expected, name);
  }
  for (const auto& entry : fs::directory_iterator(k_config / "scenes" / "door"))
    EXPECT_TRUE(files.contains(entry.path().filename().string())) << entry.path();
}

TEST(CarDoor, TheLoadedSceneIsTheOneInMemory) {
  const auto loaded = scene::load_scene(k_config / "scenes" / "door");
  ASSERT_TRUE(loaded) << loaded.message();
  const scene::Scene made = sim::car_door_scene();
  EXPECT_EQ(loaded->prototype->mesh.triangles.size(), made.prototype->mesh.triangles.size());
  ASSERT_EQ(loaded->prototype->markers.size(), made.prototype->markers.size());
  for (std::size_t i = 0; i < made.prototype->markers.size(); ++i)
    EXPECT_TRUE(pose_near(loaded->prototype->markers[i].body_from_marker,
                          made.prototype->markers[i].body_from_marker, 1e-8, 1e-8));
  ASSERT_EQ(loaded->slots.size(), 2U);
  EXPECT_EQ(loaded->slots[0].variants.size(), 3U);
  EXPECT_EQ(loaded->slots[0].mode, scene::Mode::view);
  EXPECT_EQ(loaded->slots[1].mode, scene::Mode::surface);
  const scene::Mesh &a = loaded->prototype->mesh, &b = made.prototype->mesh;
  for (std::size_t t = 0; t < b.triangles.size();
       ++t)  // the loader may renumber corners and rotate a triangle's corners
    for (std::size_t k = 0; k < 3; ++k) {
      const auto gap = [&](std::size_t j) {
        return (a.positions[a.triangles[t][j]] - b.positions[b.triangles[t][k]]).norm();
      };
      ASSERT_EQ(std::min({gap(0), gap(1), gap(2)}), 0) << t;
    }
}

TEST(CarDoor, ThePanelHasItsSizeAndRelief) {
  const scene::Mesh mesh = sim::car_door_scene().prototype->mesh;
  Eigen::AlignedBox3f box;
  float lowest_front = 1;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    box.extend(mesh.positions[i]);
    if (mesh.normals[i].z() > 0.3F) lowest_front = std::min(lowest_front, mesh.positions[i].z());
  }
  EXPECT_NEAR(box.sizes().x(), 0.6, 0.03);
  EXPECT_NEAR(box.sizes().y(), 0.4, 0.03);
  EXPECT_NEAR(box.max().z() - lowest_front, 0.1, 0.02);
}

TEST(CarDoor, FacesLookOutwardsAndNormalsAgreeWithThem) {
  const scene::Scene scene = sim::car_door_scene();
  std::vector<const scene::Mesh*> meshes = {&scene.prototype->mesh};
  for (const scene::Slot& slot : scene.slots)
    for (const scene::Variant& variant : slot.variants) meshes.push_back(&variant.mesh);
  for (const scene::Mesh* mesh : meshes) {
    int against = 0;
    for (const auto& [a, b, c] : mesh->triangles) {
      const Eigen::Vector3f n =
          (mesh->positions[b] - mesh->positions[a]).cross(mesh->positions[c] - mesh->positions[a]);
      if (n.norm() < 1e-10F) continue;
      if (n.normalized().dot((mesh->normals[a] + mesh->normals[b] + mesh->normals[c]).normalized()) < 0.2F)
        ++against;
    }
    EXPECT_LE(against, static_cast<int>(mesh->triangles.size() / 100));
  }
}

TEST(CarDoor, TheTrimLiesOnTheSurfaceWithinAFifthOfAMillimetre) {
  const scene::Scene scene = sim::car_door_scene();
  const scene::Slot& trim = scene.slots[1];
  std::vector<Track> tracks(2);
  tracks[0].body = "prototype";
  tracks[1].body = "trim";
  tracks[1].world_from_body = sim::car_door_slot_places().at("trim");
  const Pose prototype_from_part = scene::posed(scene, tracks).parts.at(0).world_from_part;
  for (const sim::SampledPoint& point : sim::surface_points(trim.variants[0].mesh, 500, 5)) {
    const scene::MeshPoint nearest = scene::nearest_on(scene.prototype->mesh, prototype_from_part * point.p);
    ASSERT_LT(nearest.distance, 0.2_mm);
    ASSERT_GT((prototype_from_part * point.p - nearest.p).dot(nearest.d_normal), 0.0) << "under the clay";
  }
}

TEST(CarDoor, PlatesTouchTheClayAndAreClearOfIt) {
  const scene::Scene scene = sim::car_door_scene();
  std::vector<Pose> plates;
  for (const BodyMarker& marker : scene.prototype->markers) plates.push_back(marker.body_from_marker);
  for (const auto& [slot, pose] : sim::car_door_slot_places()) plates.push_back(pose);
  EXPECT_GE(plates.size(), 8U);
  for (const Pose& plate : plates) {
    double least = 1, most = 0;
    for (int r = -5; r <= 5; ++r)
      for (int c = -5; c <= 5; ++c) {
        const Eigen::Vector3d p = plate * Eigen::Vector3d(c * 0.0052, r * 0.0052, 0);
        const scene::MeshPoint nearest = scene::nearest_on(scene.prototype->mesh, p);
        const double height = (p - nearest.p).dot(nearest.d_normal);
        least = std::min(least, height), most = std::max(most, height);
      }
    EXPECT_GT(least, 0.1_mm);
    EXPECT_LT(least, 0.6_mm);
    EXPECT_LT(most, 4.0_mm);  // curvature of the clay below a plate's corners
  }
}

TEST(CarDoor, TheWorldsStandTheSlotMarkersWhereTheGeneratorSays) {
  for (const char* name : {"bench.json", "studio.json"}) {
    const sim::World world = sim::load_world(k_config / "worlds" / name, plain_marker).value();
    for (const scene::Slot& slot : world.scene->slots) {
      const Pose found = world.world_from_prototype.inverse() * *sim::world_from_marker(world, slot.marker);
      EXPECT_TRUE(pose_near(found, sim::car_door_slot_places().at(slot.name), 1e-6, 1e-6));
    }
  }
}

// With the door in place, moved by 150 mm and turned by 40°, the studio's camera sees enough markers and both
// projectors reach the door.
TEST(CarDoor, TheStudioSeesTheDoorInItsWholeWorkingVolume) {
  sim::World world = sim::load_world(k_config / "worlds" / "studio.json", plain_marker).value();
  const Pose home = world.world_from_prototype;
  const auto turned = [&](double degrees) {
    return Pose(exp_rotation({0, 0, degrees * std::numbers::pi / 180}) * home.rotation, home.translation);
  };
  const Pose right(home.rotation, home.translation + Eigen::Vector3d(0.15, 0, 0));
  const Pose left(home.rotation, home.translation - Eigen::Vector3d(0.15, 0, 0));
  for (const Pose& place : {home, left, right, turned(40), turned(-40)}) {
    sim::move_prototype(world, place);
    const sim::Truth truth(world);
    const Imager& camera = world.rig.cameras[0];
    int seen = 0;
    for (const sim::PlacedMarker& marker : world.markers) {
      const Pose pose = *sim::world_from_marker(world, marker.marker);
      const double h = marker.size_m / 2;
      const auto a = camera.project(pose * Eigen::Vector3d(0, -h, 0)),
                 b = camera.project(pose * Eigen::Vector3d(0, h, 0));
      const bool large = a && b && (*a - *b).norm() >= 40;
      if (large && truth.visible(camera, pose * Eigen::Vector3d(h, h, 0)) &&
          truth.visible(camera, pose * Eigen::Vector3d(-h, -h, 0)))
        ++seen;
    }
    EXPECT_GE(seen, 8);
    int reached = 0, count = 0;
    for (const sim::SampledPoint& point : sim::surface_points(world.scene->prototype->mesh, 400, 1)) {
      if (point.n.z() < 0.7) continue;  // sides and back
      ++count;
      for (const Imager& projector : world.rig.projectors)
        if (truth.visible(projector, place * point.p)) {
          ++reached;
          break;
        }
    }
    EXPECT_GE(reached, count * 85 / 100);  // marker plates cover the rest
  }
}

// The designer sees every mirror partly in front of the door and partly beyond its edge.
TEST(CarDoor, EveryMirrorOverhangsTheDoorInPart) {
  const sim::World world = sim::load_world(k_config / "worlds" / "studio.json", plain_marker).value();
  for (const scene::Variant& variant : world.scene->slots[0].variants) {
    const std::vector<std::string> variants = {variant.name};
    const sim::Truth truth(world, sim::true_poses(world, variants));
    const cv::Mat mask = truth.part_mask(*world.scene->viewers.at(0).fixed, "mirror");
    const double on = cv::countNonZero(mask == 255), off = cv::countNonZero(mask == 128);
    EXPECT_GT(on / (on + off), 0.15) << variant.name;
    EXPECT_GT(off / (on + off), 0.15) << variant.name;
  }
}

}  // namespace
}  // namespace limn
