#include "scene/posed_scene.h"

#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/tracks.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;
using namespace test::literals;
using test::track_of;

// Half of a cylinder of radius 0.5 along y, whose outside faces -z.
Mesh half_cylinder() {
  Mesh mesh;
  constexpr int k_steps = 180;
  for (int i = 0; i <= k_steps; ++i) {
    const double a = M_PI * (1.0 * i / k_steps - 0.5);
    for (const double y : {-0.5, 0.5}) {
      mesh.positions.push_back(Vector3d(0.5 * std::sin(a), y, -0.5 * std::cos(a)).cast<float>());
      mesh.normals.push_back(Vector3d(std::sin(a), 0, -std::cos(a)).cast<float>());
    }
  }
  for (std::uint32_t i = 0; i < k_steps; ++i) {
    mesh.triangles.push_back({2 * i, 2 * i + 1, 2 * i + 2});
    mesh.triangles.push_back({2 * i + 2, 2 * i + 1, 2 * i + 3});
  }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

Scene two_slots(bool stick) {
  Scene scene;
  scene.prototype = Prototype{half_cylinder(), {}, 0.8, {}};
  for (const char* name : {"mirror", "trim"}) {
    Slot slot;
    slot.name = name;
    slot.marker_from_part = Pose(exp_rotation({0.1, 0.2, 0.3}), {0.01, 0.02, -0.03});
    slot.stick_to_surface = stick;
    slot.variants = {{"a", {}}, {"b", {}}};
    scene.slots.push_back(slot);
  }
  return scene;
}

TEST(Posed, PartsRideOnTheirMarkersAndUnseenOnesAreAbsent) {
  const Scene scene = two_slots(false);
  const Pose world_from_marker(exp_rotation({0.4, -0.2, 0.1}), {1, 2, 3});
  const Track tracks[] = {track_of("trim", world_from_marker)};
  const std::string variants[] = {"", "b"};
  const PosedScene out = posed(scene, tracks, variants);
  EXPECT_FALSE(out.world_from_prototype);
  ASSERT_EQ(out.parts.size(), 1u);
  EXPECT_EQ(out.parts[0].slot, "trim");
  EXPECT_EQ(out.parts[0].variant, "b");
  EXPECT_TRUE(test::pose_near(out.parts[0].world_from_part,
                              world_from_marker * scene.slots[1].marker_from_part, 1e-9, 1e-9));
  EXPECT_EQ(posed(scene, tracks).parts[0].variant, "a");
}

TEST(Posed, LostPartIsAbsentAndAnExtrapolatedOneIsNot) {
  const Scene scene = two_slots(false);
  std::array<Track, 2> tracks = {track_of("mirror", Pose{}), track_of("trim", Pose{})};
  tracks[0].tracking = TrackingState::lost;
  tracks[1].tracking = TrackingState::extrapolated;
  const PosedScene out = posed(scene, tracks);
  ASSERT_EQ(out.parts.size(), 1u);
  EXPECT_EQ(out.parts[0].slot, "trim");
}

TEST(Posed, StickingPartThatWasNotSeenForHoursIsLaidOnTheNearestPlace) {
  const Scene scene = two_slots(true);
  std::array<Track, 2> tracks = {track_of("prototype", Pose{}),
                                 track_of("mirror", Pose(Eigen::Quaterniond::Identity(), {0, 0.1, -0.6}))};
  // Not positive definite in floating point once it is turned and the place's own error is added.
  const Vector3d d = Vector3d(1, 2, 3).normalized();
  tracks[1].covariance.bottomRightCorner<3, 3>() = 1e30 * d * d.transpose();
  const PosedScene out = posed(scene, tracks);
  ASSERT_EQ(out.parts.size(), 1u);
  const Pose world_from_marker = out.parts[0].world_from_part * scene.slots[0].marker_from_part.inverse();
  EXPECT_LT((world_from_marker.translation - Vector3d(0, 0.1, -0.5)).norm(), 1e-6);
}

TEST(Posed, StickingPartIsLaidOntoTheSurfaceAndKeepsItsTurn) {
  Scene scene = two_slots(true);
  const Pose world_from_prototype(exp_rotation({0.3, 1.2, -0.4}), {0.5, -0.2, 2});
  for (const double side : {1.0, -1.0}) {  // with outward normals, then with inward ones
    if (side < 0) {
      for (auto& n : scene.prototype->mesh.normals) n = -n;
    }
    // The true pose: on the cylinder at 30 degrees, rotated by 0.7 rad about the normal.
    const double a = M_PI / 6;
    const Eigen::AngleAxisd round(-a, Vector3d::UnitY()), turn(0.7, Vector3d::UnitZ());
    const Pose on_surface(Eigen::Quaterniond(round * turn), {0.5 * std::sin(a), 0.1, -0.5 * std::cos(a)});
    // The measured pose: 8 mm off along the normal, tilted by 5 degrees about an axis in the surface.
    const Vector3d d_out = on_surface.rotation * -Vector3d::UnitZ();
    const Eigen::Quaterniond tilt = exp_rotation(on_surface.rotation * Vector3d(5.0_deg, 0, 0));
    const Pose measured(tilt * on_surface.rotation, on_surface.translation + 0.008 * d_out);
    const Track tracks[] = {track_of("prototype", world_from_prototype),
                            track_of("mirror", world_from_prototype * measured)};
    const PosedScene out = posed(scene, tracks);
    ASSERT_EQ(out.parts.size(), 1u);
    const Pose expected = world_from_prototype * on_surface * scene.slots[0].marker_from_part;
    EXPECT_TRUE(test::pose_near(out.parts[0].world_from_part, expected, 0.6_deg, 0.2_mm));
  }
}

TEST(Posed, WithoutThePrototypeThereIsNothingToStickTo) {
  const Scene scene = two_slots(true);
  const Track tracks[] = {track_of("mirror", Pose(exp_rotation({0, 0, 1}), {1, 0, 0}))};
  EXPECT_TRUE(test::pose_near(posed(scene, tracks).parts[0].world_from_part,
                              tracks[0].world_from_body * scene.slots[0].marker_from_part, 1e-9, 1e-9));
}

TEST(Poses, FileIsReadAndUnknownNamesAreErrors) {
  const Scene scene = two_slots(false);
  const auto file = test::test_folder() / "poses.json";
  const Pose pose(exp_rotation({0.1, 0.2, 0.3}), {1, 2, 3});
  nlohmann::json json = {{"world_from_prototype", to_json(pose)},
                         {"slots", {{"mirror", {{"world_from_part", to_json(pose)}, {"variant", "b"}}}}}};
  const auto load = [&] {
    EXPECT_TRUE(write_file(file, json.dump()));
    return load_poses(file, scene);
  };
  const auto whole = load();
  ASSERT_TRUE(whole) << whole.message();
  EXPECT_TRUE(test::pose_near(*whole->world_from_prototype, pose, 1e-7, 1e-9));
  EXPECT_EQ(whole->parts[0].variant, "b");

  json["slots"]["mirror"].erase("variant");
  EXPECT_EQ(load()->parts[0].variant, "a");
  json["slots"]["mirror"]["variant"] = "z";
  ASSERT_FALSE(load());
  EXPECT_NE(load().message().find("slots.mirror.variant"), std::string::npos) << load().message();
  json["slots"]["mirror"]["variant"] = "a";
  json["slots"]["grille"] = json["slots"]["mirror"];
  ASSERT_FALSE(load());
  EXPECT_NE(load().message().find("grille"), std::string::npos);
  json["slots"].erase("grille");
  json["time"] = 3;
  EXPECT_FALSE(load());
}

}  // namespace
}  // namespace limn::scene
