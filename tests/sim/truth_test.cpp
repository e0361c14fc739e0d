#include "sim/truth.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test;

// A scene with one part in the slot "part": a square of side 0.2 m, frame at its centre, facing -z.
scene::Scene one_part_scene(scene::Mode mode) {
  scene::Slot slot;
  slot.name = "part";
  slot.marker = {"aruco_4x4_50", "0"};
  slot.size_m = 0.04;
  slot.mode = mode;
  slot.variants.push_back({"only", *sim::sheet("", 0.2, 0.2, {}, Pose()).mesh});
  scene::Scene scene;
  scene.slots.push_back(std::move(slot));
  return scene;
}

// The prototype is a square of side 0.4 m at y = 1 in front of a wall. The part stands `gap` in front of the
// prototype; half of it extends beyond the right edge.
struct PartScene {
  sim::World world = small_world(1.5);
  scene::PosedScene parts;
  explicit PartScene(double gap, scene::Mode mode = scene::Mode::view) {
    world.scene = one_part_scene(mode);
    world.world_from_prototype = facing_minus_y(0, 1, 0);
    world.objects.push_back(sim::sheet("prototype", 0.4, 0.4, {}, world.world_from_prototype));
    parts.world_from_prototype = world.world_from_prototype;
    parts.parts = {{"part", "only", facing_minus_y(0.2, 1 - gap, 0)}};
  }
};

TEST(Truth, APixelsLightLandsOnItsOwnRay) {
  const sim::World world = small_world();
  const sim::Truth truth(world);
  const Imager& projector = world.rig.projectors[0];
  for (const Eigen::Vector2d& px :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(100.3, 70.8), Eigen::Vector2d(199, 149)}) {
    const auto landing = truth.landing(projector, px);
    ASSERT_TRUE(landing);
    EXPECT_EQ(landing->object, "wall");
    EXPECT_NEAR(landing->p_world.y(), 1, 1e-6);
    EXPECT_TRUE(near(*projector.project(landing->p_world), px, 1e-4));
    EXPECT_TRUE(near(world.objects[0].world_from_object * landing->p_object, landing->p_world, 1e-9));
    EXPECT_TRUE(near(landing->n_world, Eigen::Vector3d(0, -1, 0), 1e-6));
  }
}

TEST(Truth, APointBehindSomethingIsNotVisible) {
  sim::World world = small_world();
  world.objects.push_back(sim::sheet("occluder", 0.1, 0.1, {}, facing_minus_y(0, 0.5, 0)));
  const sim::Truth truth(world);
  const Imager& camera = world.rig.cameras[0];
  EXPECT_FALSE(truth.visible(camera, {0, 1, 0}));
  EXPECT_FALSE(truth.visible(camera, {0.09, 1, 0}));
  EXPECT_TRUE(truth.visible(camera, {0.11, 1, 0}));
  EXPECT_TRUE(truth.visible(camera, {0, 0.5, 0}));   // the occluder's own surface
  EXPECT_FALSE(truth.visible(camera, {0.9, 1, 0}));  // beside the image
}

TEST(Truth, APartIsOnSurfaceBeforeThePrototypeAndOffBeyondItsEdge) {
  const PartScene part_scene(0.1);
  const Imager& camera = part_scene.world.rig.cameras[0];
  const cv::Mat mask = sim::Truth(part_scene.world, part_scene.parts).part_mask(camera, "part");
  // The part spans x 0.1 … 0.3 m at 0.9 m; the prototype ends at x = 0.2 m at 1 m: pixel columns by hand.
  const double left = 159.5 + 400 * 0.1 / 0.9, right = 159.5 + 400 * 0.3 / 0.9, edge = 159.5 + 400 * 0.2;
  for (int c = 0; c < 320; ++c) {
    const int expected = c < left || c > right ? 0 : c < edge ? 255 : 128;
    if (std::min({std::abs(c - left), std::abs(c - right), std::abs(c - edge)}) < 0.01) continue;
    ASSERT_EQ(mask.at<std::uint8_t>(120, c), expected) << c;
  }
  EXPECT_EQ(mask.at<std::uint8_t>(5, 200), 0);
}

TEST(Truth, AShadowOfThePrototypeItselfIsOffSurface) {
  PartScene part_scene(0.1);
  part_scene.world.rig.projectors[0].imager_from_world =
      looking_at({0.3, 3, 0.1}, {0, 1, 0}, Eigen::Vector3d::UnitZ());
  const cv::Mat mask =
      sim::Truth(part_scene.world, part_scene.parts).part_mask(part_scene.world.rig.cameras[0], "part");
  EXPECT_EQ(cv::countNonZero(mask == 255), 0);  // illuminated from behind only
  EXPECT_GT(cv::countNonZero(mask == 128), 5000);
}

TEST(Truth, ThePrototypeHidesPartsBehindIt) {
  const PartScene part_scene(-0.05);
  const cv::Mat mask =
      sim::Truth(part_scene.world, part_scene.parts).part_mask(part_scene.world.rig.cameras[0], "part");
  EXPECT_EQ(cv::countNonZero(mask == 255), 0);
  EXPECT_EQ(mask.at<std::uint8_t>(120, 230), 0);    // behind the prototype
  EXPECT_EQ(mask.at<std::uint8_t>(120, 250), 128);  // beside it
}

TEST(Truth, ASurfacePartMayLieUpToTwoMillimetresDeep) {
  for (const auto& [gap, seen] : {std::pair{-0.0015, true}, {-0.0025, false}}) {
    const PartScene surface(gap, scene::Mode::surface), view(gap, scene::Mode::view);
    const Imager& camera = surface.world.rig.cameras[0];
    EXPECT_EQ(sim::Truth(surface.world, surface.parts).part_mask(camera, "part").at<std::uint8_t>(120, 220),
              seen ? 255 : 0);
    EXPECT_EQ(sim::Truth(view.world, view.parts).part_mask(camera, "part").at<std::uint8_t>(120, 220), 0);
  }
}

TEST(Truth, ObjectImageNamesTheNearestThing) {
  const PartScene part_scene(0.1);
  const sim::ObjectImage seen =
      sim::Truth(part_scene.world, part_scene.parts).object_image(part_scene.world.rig.cameras[0]);
  const auto name = [&](int c, int r) {
    return seen.names.at(static_cast<std::size_t>(seen.image.at<std::int16_t>(r, c)));
  };
  EXPECT_EQ(name(160, 120), "prototype");
  EXPECT_EQ(name(230, 120), "part-part");
  EXPECT_EQ(name(10, 120), "wall");
}

TEST(Truth, SurfacePointsAreUniformByAreaAndOnTheMesh) {
  scene::Mesh mesh =
      // Two triangles of this sheet; a third one beside them has three times the area.
      *sim::sheet("", 1, 1, {}, Pose()).mesh;
  mesh.positions.insert(mesh.positions.end(), {{1, 0, 0}, {3, 0, 0}, {1, 3, 0}});
  mesh.normals.insert(mesh.normals.end(), 3, {0, 0, -1});
  mesh.triangles.push_back({4, 5, 6});
  const auto points = sim::surface_points(mesh, 20000, 7);
  ASSERT_EQ(points.size(), 20000U);
  int beside = 0;
  double x = 0;
  for (const sim::SampledPoint& point : points) {
    EXPECT_EQ(point.p.z(), 0);
    EXPECT_TRUE(near(point.n, Eigen::Vector3d(0, 0, -1), 1e-6));
    if (point.p.x() >= 1) ++beside, x += point.p.x();
  }
  EXPECT_NEAR(beside / 20000.0, 0.75, 0.012);  // four standard deviations
  EXPECT_NEAR(x / beside, 1 + 2.0 / 3, 0.02);  // centroid of the triangle
  EXPECT_EQ(sim::surface_points(mesh, 10, 7)[3].p, points[3].p);
}

TEST(Truth, AWorldWithPartsShowsThem) {
  const PartScene part_scene(0.1);
  const sim::World shown = sim::with_parts(part_scene.world, part_scene.parts);
  const auto landing = sim::Truth(shown).landing(shown.rig.cameras[0], {230, 120});
  ASSERT_TRUE(landing);
  EXPECT_EQ(landing->object, "part-part");
  EXPECT_NEAR(landing->p_world.y(), 0.9, 1e-6);
}

}  // namespace
}  // namespace limn
