#include "session/perception.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/json_text.h"
#include "session/requests/script.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"
#include "tracker/camera_encoding.h"
#include "tracker/predict.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

// Light for a marker in a hand must arrive where the marker is then: motion at 0.5 Hz with at most 0.25 m/s,
// 60 ms latency.
TEST(Perception, PredictionMakesUpForTheLag) {
  constexpr double k_lag_s = 0.060, k_begins_s = 0.5, k_ends_s = 2.0, k_runs_s = 2.4;
  constexpr double k_amplitude_m = 0.25 / (2 * M_PI * 0.5);
  const fs::path folder = test::test_folder();
  const auto script = load_script(
      write_json(folder / "script.json", script_of(k_runs_s, {{{"at_s", k_begins_s},
                                                               {"until_s", k_ends_s},
                                                               {"sway", k_mirror},
                                                               {"amplitude_m", {k_amplitude_m, 0, 0}},
                                                               {"hz", 0.5}}})));
  ASSERT_TRUE(script) << script.message();
  const MarkerName marker = MarkerName::parse(k_mirror).value();
  sim::World world = studio_world();
  const Pose world_from_marker = *sim::world_from_marker(world, marker);
  const Eigen::Vector3d p_eye = world.rig.cameras[0].imager_from_world.inverse().translation;
  const Pose camera_from_world = looking_at(p_eye, world_from_marker.translation, Eigen::Vector3d::UnitZ());
  // The marker's side is 62 px.
  world.rig.cameras[0] = viewer_imager(camera_from_world.inverse(), 640, 320, 11);
  world.rig.cameras[0].name = "camera0";
  sim::VirtualRig rig(std::move(world), {.grab_waits_for_light = false});
  auto room = ScriptedRoom::create(*script, &rig);
  ASSERT_TRUE(room) << room.message();
  auto perception = Perception::create(*rig.world().scene, rig.world().rig);
  ASSERT_TRUE(perception) << perception.message();
  double filtered = 0, held = 0, still = 0, overshoot_m = 0;
  int moving = 0, resting = 0;
  while (rig.next_exposure() < shifted(Stamp{}, k_runs_s)) {
    const double captured_s = seconds_between(Stamp{}, rig.next_exposure());
    room->set(captured_s);
    const int camera = 0;
    const Percepts& percepts = perception->watch(rig.expose(std::span(&camera, 1)));
    const double shown_s = captured_s + k_lag_s;
    const Eigen::Vector3d p_true = room->world_from_marker(marker, shown_s).translation;
    const auto off = [&](tracker::Prediction how) {
      for (const Track& track : tracker::predicted(percepts.motions, shifted(Stamp{}, shown_s), how))
        if (track.body == "mirror") return (track.world_from_body.translation - p_true).norm();
      return 1.0;
    };
    const double now = off(tracker::Prediction::filtered);
    if (shown_s > 0.3 && shown_s < k_begins_s) {
      still += now * now;
      ++resting;
    }
    if (shown_s > k_begins_s + 0.3 && shown_s < k_ends_s) {
      filtered += now * now;
      held += std::pow(off(tracker::Prediction::hold), 2);
      ++moving;
    }
    if (shown_s >= k_ends_s) overshoot_m = std::max(overshoot_m, now);  // after it has stopped
  }
  const double filtered_mm = 1e3 * std::sqrt(filtered / moving), held_mm = 1e3 * std::sqrt(held / moving);
  std::printf("in motion %.2f mm RMS, without prediction %.2f; after the stop at most %.2f; still %.3f\n",
              filtered_mm, held_mm, 1e3 * overshoot_m, 1e3 * std::sqrt(still / resting));
  EXPECT_LE(filtered_mm, 1.5);
  EXPECT_LE(filtered_mm, 0.15 * held_mm);
  EXPECT_LE(1e3 * overshoot_m, 3);
  EXPECT_LE(1e3 * std::sqrt(still / resting), 0.1);
}

TEST(Perception, LooksForCoveredMarkersWhileOneIsMissing) {
  sim::World world = studio_world();
  const MarkerName control = MarkerName::parse("apriltag_36h11:9").value();
  world.scene->controls = {{control, scene::ActionId::next_variant, "mirror", Gesture::cover}};
  const Pose lying(Eigen::Quaterniond(0.707106781, -0.707106781, 0, 0), {-0.35, -0.15, 0.45});
  ASSERT_TRUE(sim::add_marker(world, {control, 0.05, lying}, false, tracker::marker_image));
  sim::VirtualRig rig(world, {.grab_waits_for_light = false});
  const int camera = 0;
  Frame whole = rig.expose(std::span(&camera, 1))[0];
  auto perception = Perception::create(*world.scene, world.rig);
  ASSERT_TRUE(perception) << perception.message();
  const auto found_in = [&](const Frame& frame) -> std::optional<tracker::Detection> {
    whole.captured_at = shifted(whole.captured_at, 1 / 30.0);
    for (const tracker::Detection& found :
         perception->watch(std::vector<Frame>{{frame.camera, frame.image, whole.captured_at}}).detections[0])
      if (found.marker == control) return found;
    return std::nullopt;
  };
  const auto marker = found_in(whole);
  ASSERT_TRUE(marker);
  std::vector<cv::Point> outline;
  for (const Eigen::Vector2d& corner : marker->corners_px)
    outline.emplace_back(static_cast<int>(corner.x()), static_cast<int>(corner.y()));
  const int side = static_cast<int>(cv::norm(outline[1] - outline[0]));
  Frame gone{whole.camera, whole.image.clone(), {}}, covered{whole.camera, whole.image.clone(), {}};
  cv::fillConvexPoly(gone.image, outline, cv::Scalar::all(40));
  cv::circle(covered.image, 0.5 * (outline[0] + outline[1]), side / 7, cv::Scalar::all(40), cv::FILLED);
  EXPECT_FALSE(found_in(gone));
  std::optional<tracker::Detection> found;
  int images = 0;
  for (; images < 3 && !found; ++images) found = found_in(covered);
  ASSERT_TRUE(found) << "in " << images << " images";
}

// A camera is turned quickly: markers are followed at their predicted positions, not searched for.
TEST(Perception, FollowsMarkersThatMoveByMoreThanHalfTheirSideAnImage) {
  sim::World world = studio_world();
  sim::VirtualRig rig(world, {.grab_waits_for_light = false});
  const int camera = 0;
  const Frame still = rig.expose(std::span(&camera, 1))[0];
  auto perception = Perception::create(*world.scene, world.rig);
  ASSERT_TRUE(perception) << perception.message();
  const std::size_t all = perception->watch(std::span(&still, 1)).detections[0].size();
  ASSERT_GE(all, 5u);
  const auto& c = perception->percepts().detections[0][0].corners_px;
  const double side = (c[1] - c[0]).norm();
  double moved = 0;
  int image = 0;
  for (const double sides : {0.3, 0.6, 0.8, 0.8, 0.8}) {
    moved += std::round(sides * side);
    Frame frame{still.camera, {}, shifted(still.captured_at, ++image / 30.0)};
    const cv::Matx23d away(1, 0, -moved, 0, 1, 0);
    cv::warpAffine(still.image, frame.image, away, still.image.size(), cv::INTER_NEAREST);
    std::size_t followed = 0;
    for (const tracker::Detection& found : perception->watch(std::span(&frame, 1)).detections[0])
      followed +=
          (found.unshadowed && found.unshadowed->age > 0) || (found.by_pattern && found.by_pattern->age > 0);
    EXPECT_EQ(followed, all) << image;
  }
}

// A world with a control marker; a hand covers it between 0.4 and 1.5 s.
class CoveredControl {
 public:
  CoveredControl() {
    sim::World world = studio_world(0.5);
    world.scene->controls = {{MarkerName::parse("aruco_4x4_50:9").value(), scene::ActionId::next_variant,
                              "mirror", Gesture::cover}};
    EXPECT_TRUE(
        sim::add_marker(world,
                        {world.scene->controls[0].marker, 0.05,
                         Pose(Eigen::Quaterniond(0.707106781, -0.707106781, 0, 0), {-0.35, -0.15, 0.45})},
                        false, tracker::marker_image));
    scene = *world.scene;
    rig.emplace(std::move(world), sim::VirtualRigOptions{.grab_waits_for_light = false});
  }

  // Calls `perceive` with each image of a camera and its time.
  void play(const std::function<void(const Frame&, double)>& perceive) {
    const auto script = load_script(
        write_json(test::test_folder() / "script.json",
                   script_of(2, {{{"at_s", 0.4}, {"until_s", 1.5}, {"cover", "aruco_4x4_50:9"}}})));
    ASSERT_TRUE(script) << script.message();
    auto room = ScriptedRoom::create(*script, &*rig);
    ASSERT_TRUE(room);
    for (int i = 0; i < 55; ++i) {
      const double at_s = seconds_between(Stamp{}, rig->next_exposure());
      room->set(at_s);
      const int camera = 0;
      perceive(rig->expose(std::span(&camera, 1))[0], at_s);
    }
  }

  scene::Scene scene;
  std::optional<sim::VirtualRig> rig;
};

TEST(Perception, ReadsWhatControlMarkersSay) {
  CoveredControl control;
  auto perception = Perception::create(control.scene, control.rig->world().rig);
  ASSERT_TRUE(perception);
  std::vector<double> used_s;
  control.play([&](const Frame& frame, double at_s) {
    for (const ControlUse& use : perception->watch(std::span(&frame, 1)).uses) {
      EXPECT_EQ(use.control, 0u);
      EXPECT_EQ(use.steps, 1);
      used_s.push_back(at_s);
    }
  });
  ASSERT_EQ(used_s.size(), 1u);
  EXPECT_GT(used_s[0], 0.85);
  EXPECT_LT(used_s[0], 1.05);
}

// The state of all bodies with all digits.
std::string text_of(const std::vector<Track>& tracks) {
  std::string text;
  for (const Track& track : tracks) {
    text += fmt::format("{} {} {}", track.body, track.at.time_since_epoch().count(), track.rms_px);
    const Eigen::Matrix4d world_from_body = track.world_from_body.matrix();
    for (const double value : world_from_body.reshaped()) text += fmt::format(" {:a}", value);
    for (const double value : track.covariance.reshaped()) text += fmt::format(" {:a}", value);
  }
  return text;
}

// What a node sends, or a recording holds, is as good as the image itself. A use of a control is not lost
// with the detections that first show it.
TEST(Perception, DetectionsGiveTheSameAsImages) {
  CoveredControl control;
  const Rig& rig = control.rig->world().rig;
  Perception by_images = Perception::create(control.scene, rig).value();
  Perception by_detections = Perception::create(control.scene, rig).value();
  Perception with_losses = Perception::create(control.scene, rig).value();
  const tracker::CameraDetectorSetup setup =
      camera_detector_setup(control.scene, PerceptionOptions().full_scan_every).value();
  tracker::CameraDetector detector(setup, rig.cameras[0].lens, tracker::encoding_of(rig, rig.cameras[0]), 7);
  std::vector<tracker::GestureReading> before;
  int uses = 0, uses_with_losses = 0, lost = 0, tracked = 0;
  control.play([&](const Frame& frame, double /*at_s*/) {
    const std::string text = json_text(tracker::to_json(detector.detect(frame)));
    const FeedInput input{.detections = {tracker::camera_detections_of(nlohmann::ordered_json::parse(text))}};
    const Percepts& wanted = by_images.watch(std::span(&frame, 1));
    const Percepts& found = by_detections.watch({}, input);
    EXPECT_EQ(text_of(found.tracks), text_of(wanted.tracks));
    EXPECT_EQ(found.captured_at, wanted.captured_at);
    EXPECT_EQ(found.uses.size(), wanted.uses.size());
    EXPECT_TRUE(found.frames[0].image.empty());
    tracked += wanted.tracks.empty() ? 0 : 1;
    uses += static_cast<int>(wanted.uses.size());
    const std::vector<tracker::GestureReading>& controls = input.detections[0].controls;
    const bool is_lost = !before.empty() && controls[0].forward > before[0].forward;
    before = controls;
    lost += is_lost;
    if (!is_lost) uses_with_losses += static_cast<int>(with_losses.watch({}, input).uses.size());
  });
  EXPECT_GT(tracked, 40);
  EXPECT_EQ(uses, 1);
  EXPECT_EQ(lost, 1);
  EXPECT_EQ(uses_with_losses, 1);
}

// A node that has another scene still, or a camera detector that counts anew, uses no control.
TEST(Perception, CountsThatBeginAnewAreNoUses) {
  CoveredControl control;
  Perception perception = Perception::create(control.scene, control.rig->world().rig).value();
  tracker::CameraDetections found{.camera = "camera0", .captured_at = shifted(Stamp{}, 1), .run = 1};
  const auto uses = [&](std::uint64_t run, std::vector<tracker::GestureReading> controls) {
    found.captured_at = shifted(found.captured_at, 1);
    found.run = run;
    found.controls = std::move(controls);
    std::vector<int> steps;
    for (const ControlUse& use : perception.watch({}, {.detections = {found}}).uses)
      steps.push_back(use.steps);
    return steps;
  };
  EXPECT_EQ(uses(1, {{.forward = 5}}), std::vector<int>());
  EXPECT_EQ(uses(1, {{.forward = 6, .backward = 1}}), (std::vector<int>{1, -1}));
  EXPECT_EQ(uses(1, {{.forward = 8}, {.forward = 1}}), std::vector<int>());
  EXPECT_EQ(uses(2, {{.forward = 9}}), std::vector<int>());
  EXPECT_EQ(uses(2, {{.forward = 10}}), std::vector<int>{1});
}

}  // namespace
}  // namespace limn::session
