#include "apps/calibrate.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "sim/world.h"
#include "tests/support/matchers.h"
#include "tests/wizard/small_plan.h"
#include "tracker/marker_image.h"
#include "wizard/pose_instructions.h"
#include "wizard/pose_quality.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using nlohmann::json;
using test::read_json;
using test::small_plan;

// What `limn calibrate --json` prints.
json calibrated_json(const apps::CalibrateOptions& options) {
  testing::internal::CaptureStdout();
  const Status status = apps::run_calibrate(options);
  const std::string printed = testing::internal::GetCapturedStdout();
  EXPECT_TRUE(status.ok()) << status.message();
  return status.ok() ? json::parse(printed) : json();
}

std::size_t images_in(const fs::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    count += entry.path().extension() == ".png" ? 1 : 0;
  return count;
}

// The prototype was scanned, its CAD is aligned, and green light falls on it.
void expect_prototype(const json& done, const fs::path& rig, const fs::path& world_file) {
  ASSERT_TRUE(done.contains("prototype")) << done;
  EXPECT_GT(done["prototype"]["points"].get<int>(), 10000);
  EXPECT_LT(done["prototype"]["align_rms_mm"].get<double>(), 1);
  EXPECT_LT(done["prototype"]["painted_p95_mm"].get<double>(), 1);
  EXPECT_GT(done["prototype"]["painted_good"].get<double>(), 0.95);

  const sim::World world = sim::load_world(world_file, tracker::marker_image).value();
  const Pose truth = world.rig.cameras[0].imager_from_world * world.world_from_prototype;
  const json found = read_json(rig / "scan/poses.json")["world_from_prototype"]["translation_m"];
  EXPECT_NEAR(found[0].get<double>(), truth.translation.x(), 1e-3);
  EXPECT_NEAR(found[1].get<double>(), truth.translation.y(), 1e-3);
  EXPECT_NEAR(found[2].get<double>(), truth.translation.z(), 2e-3);

  const cv::Mat light = read_image(rig / "scan/projector-projector0.png").value();
  std::size_t lit = 0, green = 0;
  for (const auto& bgr : cv::Mat_<cv::Vec3b>(light)) {
    lit += bgr[1] > 0;
    green += bgr[1] > 1.2 * bgr[2] && bgr[1] > 1.2 * bgr[0];
  }
  EXPECT_GT(lit, light.total() / 10);
  EXPECT_EQ(green, lit);
  // The camera sees this light on the prototype, and black beside it.
  const cv::Mat seen = read_grey_image(rig / "scan/painted-camera0.png").value();
  EXPECT_GT(cv::countNonZero(seen > 80), static_cast<int>(seen.total() / 12));
  EXPECT_LT(cv::countNonZero(seen > 80), static_cast<int>(seen.total() / 3));
}

// Calibrates from nothing, then continues after an interrupted pose, then refuses another plan.
TEST(Calibrate, GoesFromNothingToAGoodRigAndOnFromWhereItWasLeft) {
  const fs::path folder = test::test_folder(), plan = small_plan(folder), out = folder / "rig";
  const apps::CalibrateOptions options{.plan = plan, .out = out, .json = true};
  const json first = calibrated_json(options);
  ASSERT_FALSE(first.is_null());
  EXPECT_EQ(first["verdict"], "good");
  const auto rig = load_rig(out);
  ASSERT_TRUE(rig.ok()) << rig.message();
  EXPECT_NEAR(rig->projectors[0].lens.fx(), 380, 4);
  // The measured latency is within 2 ms of the virtual projector's.
  EXPECT_NEAR(first["latency_ms"]["projector0"].get<double>(), 33, 2);
  EXPECT_NEAR(read_json(out / "rig.json")["provenance"]["display_latency_ms"]["projector0"].get<double>(), 33,
              2);
  EXPECT_TRUE(fs::exists(out / "report.html"));
  EXPECT_EQ(read_json(out / "report.json")["verdict"], "good");

  // It stopped when more poses no longer helped: the rig is good, and poses of the plan are left.
  const json& poses = first["poses"];
  ASSERT_GE(poses.size(), 5U);
  EXPECT_LT(poses.size(), 9U);
  EXPECT_TRUE(poses[0].contains("unsolved"));
  EXPECT_FALSE(poses[0].contains("verdict"));
  for (std::size_t i = 3; i < poses.size(); ++i) {
    EXPECT_FALSE(poses[i]["captured_before"].get<bool>());
    EXPECT_LT(poses[i]["held_out_px"].get<double>(), 0.5);
    EXPECT_GT(poses[i]["coverage"]["projector0"].get<double>(), 0.2);
  }
  EXPECT_NE(poses[2]["more_helps"], "");
  EXPECT_EQ(poses.back()["more_helps"], "")
      << "it goes on until more do not help and the whole solve is good";
  // 36 images for each pose, one every two frames of 1/30 s, and the wait for the last one.
  const double capture_s = first["capture_s"]["projector0"];
  EXPECT_NEAR(capture_s, static_cast<double>(poses.size()) * 36 * 2 / 30.0, 1);
  const fs::path captures = out / "captures";
  ASSERT_EQ(images_in(captures), poses.size() * 36);

  // Interrupted in pose 2: complete poses stay as they are, and pose 2 is captured again completely.
  const auto written_at = [&](const char* file) { return fs::last_write_time(captures / file); };
  const auto kept = written_at("pose01/camera0/035.png"), torn = written_at("pose02/camera0/000.png");
  fs::remove(captures / "pose02/camera0/035.png");
  fs::remove(out / "rig.json");
  apps::CalibrateOptions with_scan = options;
  with_scan.scan = true;
  const json second = calibrated_json(with_scan);
  ASSERT_FALSE(second.is_null());
  expect_prototype(second, out, folder / "world.json");
  EXPECT_EQ(read_json(out / "report.json")["scale_rests_on"], "cad");
  EXPECT_EQ(second["verdict"], "good");
  ASSERT_EQ(second["poses"].size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_EQ(second["poses"][i]["captured_before"].get<bool>(), i != 2) << i;
  EXPECT_EQ(written_at("pose01/camera0/035.png"), kept);
  EXPECT_GT(written_at("pose02/camera0/000.png"), torn);
  EXPECT_TRUE(fs::exists(captures / "pose02/camera0/035.png"));
  EXPECT_NEAR(second["capture_s"]["projector0"].get<double>(), 36 * 2 / 30.0, 0.2);
  EXPECT_TRUE(fs::exists(out / "rig.json"));

  // Another plan is refused; the message says what differs, and nothing changes.
  json other = read_json(plan);
  other["board"] = "charuco:8x6:56mm";
  ASSERT_TRUE(write_file(plan, other.dump(2)).ok());
  const Status refused = apps::run_calibrate(options);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.message().find("plan.board"), std::string::npos) << refused.message();
  EXPECT_NE(refused.message().find("charuco:8x6:55mm"), std::string::npos) << refused.message();
  EXPECT_NE(refused.message().find("charuco:8x6:56mm"), std::string::npos) << refused.message();
  EXPECT_EQ(images_in(captures), poses.size() * 36);
}

TEST(Calibrate, LeavesCapturesOfOthersAlone) {
  const fs::path folder = test::test_folder(), plan = small_plan(folder);
  ASSERT_TRUE(make_folder(folder / "rig/captures").ok());
  ASSERT_TRUE(write_file(folder / "rig/captures/capture.json", "{}").ok());
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) {
    testing::internal::CaptureStderr();
    EXPECT_FALSE(apps::run_calibrate({.plan = plan, .out = folder / "rig"}).ok());
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_NE(said.find("in the terminal"), std::string::npos) << said;
  }
  const Status refused = apps::run_calibrate({.plan = plan, .out = folder / "rig", .terminal = true});
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.message().find("Choose another --out"), std::string::npos) << refused.message();
  EXPECT_EQ(read_file(folder / "rig/captures/capture.json").value(), "{}");
}

PoseJudged judged(double predicted_mm, calib::Verdict verdict = calib::Verdict::good) {
  PoseJudged pose;
  pose.assessment.emplace();
  pose.assessment->verdict = verdict;
  pose.assessment->predicted_error_mm = {predicted_mm / 2, predicted_mm};
  return pose;
}

TEST(Calibrate, PosesHelpUntilTheRigIsGoodAndItsErrorFallsNoMore) {
  EXPECT_FALSE(more_helps({}).empty());
  EXPECT_FALSE(more_helps({PoseJudged{}}).empty());
  EXPECT_FALSE(more_helps({judged(0.1, calib::Verdict::usable)}).empty());
  EXPECT_FALSE(more_helps({judged(0.8)}).empty()) << "nothing to compare with";
  EXPECT_FALSE(more_helps({judged(0.8), judged(0.7), judged(0.7)}).empty()) << "fell by an eighth";
  std::vector<PoseJudged> settled(7, judged(0.79));
  EXPECT_FALSE(more_helps(settled).empty()) << "too few to judge the accuracy";
  settled.push_back(judged(0.78));
  EXPECT_TRUE(more_helps(settled).empty());
  EXPECT_TRUE(more_helps({judged(0.8), judged(0.4), judged(0.2)}).empty()) << "fine enough";
  PoseJudged bare = judged(0.2);
  bare.assessment->faults = {{calib::FaultName::low_coverage, "", "", calib::Severity::note}};
  EXPECT_EQ(more_helps({bare}), "low_coverage");
}

TEST(Calibrate, TellsPlacesAsTheCameraSeesThem) {
  const Imager camera{"camera0", 640, 480, Lens::pinhole(600, 600, 319.5, 239.5), Pose()};
  const calib::Board board = calib::Board::parse("charuco:8x6:40mm").value();
  // A board pose with the board's centre at p, rotated by r about the camera's axes.
  const auto held = [&](const Vector3d& r, const Vector3d& p) {
    return Pose(exp_rotation(r), p) *
           Pose(Eigen::Quaterniond::Identity(), {-board.width_m() / 2, -board.height_m() / 2, 0});
  };
  const auto words = pose_instructions(
      camera, board,
      {held({0, 0, 0}, {0, 0, 1}), held({0.5, 0, 0}, {-0.5, 0, 1.5}),  // its upper edge is nearer
       held({0, 0.5, 0}, {0, 0.5, 2}),                                 // its right edge is nearer
       held({0, 0, 0.5}, {0, 0, 1}), held({0, 0, 0}, {3, 0, 1})});
  EXPECT_EQ(words[0], "middle, near (1.00 m), facing the camera");
  EXPECT_EQ(words[1].substr(0, 20), "left, near (1.58 m),");
  EXPECT_EQ(words[2], "low (2.06 m), tilted 32 degrees down and left");
  EXPECT_NE(words[3].find("turned 29 degrees clockwise"), std::string::npos) << words[3];
  EXPECT_EQ(words[4].substr(0, 19), "outside its image, ");
}

}  // namespace
}  // namespace limn::wizard
