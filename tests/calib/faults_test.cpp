#include "calib/judge/faults.h"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/judge/assess.h"
#include "calib/judge/capture_faults.h"
#include "calib/observations.h"
#include "calib/solve.h"
#include "tests/calib/fault_bench.h"
#include "tests/support/matchers.h"

// Each test captures on the virtual rig with one fault injected and reads the report. Run the program to get
// the table of faults, names found and verdicts.

namespace limn::calib {
namespace {

using namespace test;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Names = std::set<std::string>;

constexpr int k_poses = 5;
constexpr int k_shots = 38;  // images of a series on the bench: 9 + 9 bits, white and black

// The report for somebody who solves the captures.
struct Diagnosis {
  Names names;
  std::string verdict;  ///< "failed" when the solve fails
  std::optional<Solution> solution;
  std::vector<Fault> faults;
};

Diagnosis diagnosis_of(const CaptureSet& captures, const std::string& injected, const Rig* earlier) {
  Diagnosis diagnosis{{}, "failed", {}, {}};
  const auto observed = observe(captures);
  EXPECT_TRUE(observed.ok()) << observed.message();
  if (!observed) return diagnosis;
  diagnosis.faults = unsolved_faults(*observed);
  if (const auto solution = solve(observed->observations)) {
    diagnosis.faults = faults(*observed, *solution, {}, {});
    auto assessment = assess(*observed, {}, *solution);
    if (assessment) {
      if (earlier) add_faults(faults_against(*earlier, solution->rig), &*assessment);
      diagnosis.verdict = to_text(assessment->verdict);
      diagnosis.faults = assessment->faults;
      for (const Fault& advice : assessment->advice) diagnosis.faults.push_back(advice);
    }
    diagnosis.solution = *solution;
  }
  std::string names;
  for (const Fault& fault : diagnosis.faults) {
    const std::string name = to_text(fault.name);
    if (diagnosis.names.insert(name).second) names += " " + name;
    EXPECT_FALSE(fault.evidence.empty() || fault.advice.empty()) << name;
  }
  printf("[ injected ] %-34s ->%s; %s\n", injected.c_str(), names.empty() ? " nothing" : names.c_str(),
         diagnosis.verdict.c_str());
  return diagnosis;
}

Diagnosis diagnosis_of(const FaultBench& bench, const std::string& injected, const Rig* earlier = nullptr) {
  const auto captures = bench.capture(test_folder() / "captures");
  EXPECT_TRUE(captures.ok()) << captures.message();
  return captures ? diagnosis_of(*captures, injected, earlier) : Diagnosis{};
}

// The fault is named, no other fault except those it implies, and the rig is not accepted.
void expect_named(const Diagnosis& diagnosis, const std::string& name, const Names& implied = {}) {
  EXPECT_TRUE(diagnosis.names.count(name)) << to_text(diagnosis.faults);
  EXPECT_NE(diagnosis.verdict, "good");
  for (const std::string& other : diagnosis.names)
    EXPECT_TRUE(other == name || implied.count(other)) << to_text(diagnosis.faults);
}

void expect_sound(const Diagnosis& diagnosis) {
  EXPECT_EQ(diagnosis.names, Names()) << to_text(diagnosis.faults);
  EXPECT_EQ(diagnosis.verdict, "good");
}

FaultBench bench(int poses = k_poses) { return FaultBench::create("bench", poses); }

// The display warps an image by a homography, with bilinear interpolation.
cv::Mat warped(const cv::Mat& image, const std::array<cv::Point2f, 4>& corners) {
  const auto w = static_cast<float>(image.cols), h = static_cast<float>(image.rows);
  const std::array<cv::Point2f, 4> from = {{{0, 0}, {w, 0}, {w, h}, {0, h}}};
  std::array<cv::Point2f, 4> to = corners;
  for (cv::Point2f& corner : to) corner = {corner.x * w, corner.y * h};
  cv::Mat panel;
  cv::warpPerspective(image, panel, cv::getPerspectiveTransform(from.data(), to.data()), image.size(),
                      cv::INTER_LINEAR);
  return panel;
}

std::function<cv::Mat(const cv::Mat&)> flipped(int how) {
  return [how](const cv::Mat& image) {
    cv::Mat panel;
    cv::flip(image, panel, how);
    return panel;
  };
}

TEST(SoundCaptures, OfTheBenchHaveNoFault) { expect_sound(diagnosis_of(bench(), "nothing, bench")); }

TEST(SoundCaptures, OfTheStudioHaveNoFault) {
  expect_sound(diagnosis_of(FaultBench::create("studio", k_poses), "nothing, studio"));
}

TEST(SoundCaptures, WithOtherNoiseHaveNoFault) {
  FaultBench noisy = bench();
  noisy.seed = 11;
  noisy.world.camera_effects[0].read_noise = 1.5;
  noisy.world.camera_effects[0].full_well_e = 4000;
  expect_sound(diagnosis_of(noisy, "nothing, bench, twice the noise"));
}

TEST(SoundCaptures, OfOtherCodesHaveNoFault) {
  for (const PatternCode code : {PatternCode::phase, PatternCode::exclusive_or}) {
    FaultBench other = bench();
    other.code = code;
    expect_sound(diagnosis_of(other, "nothing, bench, " + to_text(code)));
  }
}

// 2.2 is assumed for projectors; no projector has exactly that.
TEST(SoundCaptures, OfAProjectorWhoseGammaIsNearlyTheWavesHaveNoFault) {
  FaultBench near = bench();
  near.code = PatternCode::phase;
  near.world.projector_effects[0].gamma = 2.35;
  expect_sound(diagnosis_of(near, "nothing, waves for gamma 2.2 at 2.35"));
}

TEST(SoundCaptures, PhotographedInARealRoomHaveNoFault) {
  const auto folder = real_data("graycode");
  if (!folder) GTEST_SKIP() << "no photographs: graycode";
  const auto captures = import_opencv_gray(
      {*folder, 1024, 768, Board::parse("chessboard:9x7:75mm").value(), "capture_*", "graycode_*.png", {}});
  ASSERT_TRUE(captures.ok()) << captures.message();
  expect_sound(diagnosis_of(*captures, "nothing, real photographs", nullptr));
}

TEST(Faults, PatternsOnADisplayThatIsNotInTheRoom) {
  FaultBench dark = bench(3);
  dark.display_of = [](int) { return -1; };
  expect_named(diagnosis_of(dark, "patterns on another display"), "wrong_display");
}

TEST(Faults, BothProjectorsPatternsOnOneDisplay) {
  FaultBench same = FaultBench::create("studio", 3);
  same.display_of = [](int) { return 0; };
  expect_named(diagnosis_of(same, "both patterns on one display"), "wrong_display",
               {"few_poses", "low_coverage"});
}

TEST(Faults, ProjectorsSwappedSinceTheLastCalibration) {
  FaultBench studio = FaultBench::create("studio", 4);
  const Diagnosis before = diagnosis_of(studio, "nothing, four poses");
  ASSERT_TRUE(before.solution.has_value());
  studio.display_of = [](int projector) { return 1 - projector; };
  const Diagnosis after = diagnosis_of(studio, "projectors swapped", &before.solution->rig);
  expect_named(after, "projectors_swapped", {"few_poses"});
}

TEST(Faults, KeystoneLeftOn) {
  FaultBench keystone = bench();
  keystone.on_panel = [](const cv::Mat& image) {
    return warped(image, {{{0.08F, 0}, {0.92F, 0}, {1, 1}, {0, 1}}});
  };
  // No projector has such an axis: poses contradict each other and the board seems bent.
  expect_named(diagnosis_of(keystone, "keystone"), "keystone_or_scaling", {"odd_pose", "board_not_flat"});
}

TEST(Faults, DisplayNotInItsNativeResolution) {
  FaultBench scaled = bench();
  scaled.mode = cv::Size(600, 375);
  expect_named(diagnosis_of(scaled, "scaled from 600x375 to 480x300"), "keystone_or_scaling");
}

TEST(Faults, BoardsAllButParallel) {
  FaultBench flat = bench();
  const Pose first = flat.world_from_board[0];
  for (size_t i = 0; i < flat.world_from_board.size(); ++i) {
    const auto n = static_cast<double>(i);
    flat.world_from_board[i] = Pose(Eigen::Quaterniond::Identity(), {0.05 * n - 0.1, 0, 0.02 * n}) * first *
                               Pose(exp_rotation({0.02 * n, 0.05 - 0.02 * n, 0}), Vector3d::Zero());
  }
  // Boards side by side also leave most of the image empty.
  expect_named(diagnosis_of(flat, "boards almost parallel"), "little_tilt", {"low_coverage"});
}

TEST(Faults, ExposureDriftsDown) {
  FaultBench drift = bench();
  drift.before_shot = [](int, int shot, sim::World* world) {
    world->camera_effects[0].exposure = 0.75 * (1 - 0.12 * shot / (k_shots - 1));
  };
  expect_named(diagnosis_of(drift, "exposure drifts by 12 %"), "exposure_drift");
}

TEST(Faults, ExposureFollowsTheLight) {
  FaultBench automatic = bench();
  automatic.before_shot = [](int, int shot, sim::World* world) {
    world->camera_effects[0].exposure = shot == k_shots - 2 ? 0.6 : shot == k_shots - 1 ? 1.0 : 0.75;
  };
  expect_named(diagnosis_of(automatic, "automatic exposure"), "exposure_drift");
}

TEST(Faults, ExposureFollowsTheLightOfNarrowStripes) {
  FaultBench automatic = bench();
  automatic.code = PatternCode::exclusive_or;
  automatic.before_shot = [](int, int shot, sim::World* world) {
    world->camera_effects[0].exposure = shot == k_shots - 2 ? 0.6 : shot == k_shots - 1 ? 1.0 : 0.75;
  };
  expect_named(diagnosis_of(automatic, "automatic exposure, xor"), "exposure_drift");
}

TEST(Faults, ProjectorGammaNotWhatTheWavesWereDrawnFor) {
  for (const double gamma : {1.4, 2.8}) {
    FaultBench other = bench();
    other.code = PatternCode::phase;
    other.world.projector_effects[0].gamma = gamma;
    const Diagnosis diagnosis = diagnosis_of(other, fmt::format("waves for gamma 2.2 at {}", gamma));
    expect_named(diagnosis, "projector_gamma");
    // The waves are right when 2.2 is multiplied by the factor in the advice.
    ASSERT_FALSE(diagnosis.faults.empty());
    const std::string& advice = diagnosis.faults[0].advice;
    const size_t at = advice.find("gamma by ");
    ASSERT_NE(at, std::string::npos) << advice;
    EXPECT_NEAR(std::stod(advice.substr(at + 9)), gamma / 2.2, 0.02);
  }
}

TEST(Faults, WhiteDrivesTheCameraToFullScale) {
  FaultBench bright = bench();
  bright.world.camera_effects[0].exposure *= 2.2;
  expect_named(diagnosis_of(bright, "exposure 2.2 times too long"), "saturated");
}

// The display is late once: in pose 2 the camera sees image 8 again instead of image 9.
void repeat_image_nine_of_pose_two(FaultBench* late) {
  const auto repeated = std::make_shared<bool>(false);
  const auto last = std::make_shared<cv::Mat>();
  late->before_shot = [=](int pose, int shot, sim::World*) { *repeated = pose == 2 && shot == 9; };
  late->on_photo = [=](const cv::Mat& photo) {
    if (!*repeated) *last = photo.clone();
    return last->clone();
  };
}

TEST(Faults, OneImageIsTheOneBefore) {
  FaultBench late = bench();
  repeat_image_nine_of_pose_two(&late);
  const Diagnosis diagnosis = diagnosis_of(late, "one picture repeated");
  expect_named(diagnosis, "repeated_pictures", {"low_decode"});  // in that pose a wide stripe is missing
  EXPECT_NE(to_text(diagnosis.faults).find("pose02, camera0 of projector0: 009.png"), std::string::npos)
      << to_text(diagnosis.faults);
}

// Blur takes the contrast of the finest stripes only; an image of wide stripes that is repeated is still
// seen.
TEST(Faults, OneImageOfABlurredSeriesIsTheOneBefore) {
  FaultBench late = bench();
  late.world.camera_effects[0].psf_px = 1.8;
  repeat_image_nine_of_pose_two(&late);
  const Diagnosis diagnosis = diagnosis_of(late, "one picture repeated, camera out of focus");
  EXPECT_TRUE(diagnosis.names.count("defocus")) << to_text(diagnosis.faults);
  expect_named(diagnosis, "repeated_pictures", {"defocus", "low_decode", "odd_pose"});
  EXPECT_NE(to_text(diagnosis.faults).find("009.png"), std::string::npos) << to_text(diagnosis.faults);
}

// What an sRGB camera shows of blurred stripes does not add up to white and black.
TEST(Faults, BlurInACameraThatIsNotLinearIsDefocusAlone) {
  FaultBench blurred = bench();
  blurred.world.camera_effects[0].psf_px = 1.8;
  blurred.world.camera_effects[0].srgb = true;
  const Diagnosis diagnosis = diagnosis_of(blurred, "camera out of focus, sRGB");
  EXPECT_FALSE(diagnosis.names.count("repeated_pictures")) << to_text(diagnosis.faults);
}

// Both are measured and taken out; one note each says what they would have cost.
TEST(Faults, ACameraThatShakesInFlickeringLightIsGoodAndSaysSo) {
  FaultBench shaken = bench();
  shaken.world.camera_effects[0].shake_px = 0.15;
  shaken.world.camera_effects[0].flicker = 0.015;
  const Diagnosis diagnosis = diagnosis_of(shaken, "shake of 0.15 px and flicker of 1.5 %");
  EXPECT_EQ(diagnosis.names, Names({"shake", "flicker"})) << to_text(diagnosis.faults);
  EXPECT_EQ(diagnosis.verdict, "good");
  ASSERT_EQ(diagnosis.faults.size(), 2U) << to_text(diagnosis.faults);
  for (const Fault& fault : diagnosis.faults) {
    EXPECT_EQ(fault.severity, Severity::note);
    EXPECT_EQ(fault.poses.size(), static_cast<size_t>(k_poses));
    EXPECT_NE(fault.evidence.find("left in, it would cost about"), std::string::npos) << fault.evidence;
  }
}

TEST(Faults, BoardMovedDuringACapture) {
  FaultBench moved = bench();
  moved.nudge = Nudge{2, 20, false, Pose(Eigen::Quaterniond::Identity(), {0.002, 0, 0.001})};
  const Diagnosis diagnosis = diagnosis_of(moved, "board moved by 2.2 mm");
  expect_named(diagnosis, "moved_during_capture", {"odd_pose"});
  EXPECT_NE(to_text(diagnosis.faults).find("pose02"), std::string::npos);
}

TEST(Faults, CameraMovedDuringACapture) {
  FaultBench moved = bench();
  moved.nudge = Nudge{3, 12, true, Pose(exp_rotation({0, 0, 0.004}), Vector3d::Zero())};
  expect_named(diagnosis_of(moved, "camera turned by 0.23 degrees"), "moved_during_capture", {"odd_pose"});
}

TEST(Faults, ProjectorOutOfFocus) {
  FaultBench blurred = bench();
  blurred.world.projector_effects[0].focus_m = 0.7;
  blurred.world.projector_effects[0].aperture_m = 0.025;
  expect_named(diagnosis_of(blurred, "projector out of focus"), "defocus");
}

TEST(Faults, CameraOutOfFocus) {
  FaultBench blurred = bench();
  blurred.world.camera_effects[0].psf_px = 1.8;
  expect_named(diagnosis_of(blurred, "camera out of focus"), "defocus");
}

TEST(Faults, CameraOutOfFocusForNarrowStripes) {
  FaultBench blurred = bench();
  blurred.code = PatternCode::exclusive_or;
  blurred.world.camera_effects[0].psf_px = 1.8;
  expect_named(diagnosis_of(blurred, "camera out of focus, xor"), "defocus");
}

TEST(Faults, ProjectionMirrored) {
  FaultBench mirrored = bench(3);
  mirrored.on_panel = flipped(1);
  expect_named(diagnosis_of(mirrored, "mirrored"), "mirrored_projection");
}

TEST(Faults, ProjectionTurnedUpsideDown) {
  FaultBench rotated = bench();
  rotated.on_panel = flipped(-1);
  expect_named(diagnosis_of(rotated, "turned by 180 degrees"), "rotated_projection");
}

TEST(Faults, CameraImageStretched) {
  FaultBench stretched = bench();
  stretched.on_photo = [](const cv::Mat& photo) {
    cv::Mat whole;
    cv::resize(photo.rowRange(24, photo.rows - 24), whole, photo.size(), 0, 0, cv::INTER_LINEAR);
    return whole;
  };
  expect_named(diagnosis_of(stretched, "camera's picture stretched"), "wrong_camera_resolution",
               {"odd_pose"});
}

TEST(Faults, CameraImageOfAnotherSizeNamesTheFile) {
  FaultBench other = bench(3);
  const auto folder = test_folder() / "captures";
  const auto captures = other.capture(folder);
  ASSERT_TRUE(captures.ok()) << captures.message();
  CaptureSet smaller = *captures;
  smaller.cameras[0].width = 640;
  smaller.cameras[0].height = 480;
  const auto observed = observe(smaller);
  ASSERT_FALSE(observed.ok());
  EXPECT_NE(observed.message().find("expected an image of 640x480 pixels, found 480x384"), std::string::npos)
      << observed.message();
}

TEST(Faults, RoomTooBright) {
  FaultBench bright = bench();
  bright.world.room.ambient *= 12;
  for (sim::Lamp& lamp : bright.world.room.lamps) lamp.illuminance_at_1m *= 12;
  bright.world.camera_effects[0].exposure *= 0.25;
  expect_named(diagnosis_of(bright, "room 12 times as bright"), "ambient_light");
}

TEST(Faults, ProjectorHardlyMeetsWhatTheCameraSees) {
  FaultBench aside = bench();
  Pose& projector = aside.world.rig.projectors[0].imager_from_world;
  projector = Pose(exp_rotation({0, 0.5, 0}), Vector3d::Zero()) * projector;
  const Diagnosis diagnosis = diagnosis_of(aside, "projector turned aside");
  EXPECT_TRUE(diagnosis.names.count("little_overlap")) << to_text(diagnosis.faults);
  // It is advice: what it costs is in the held-out and predicted errors, which decide the verdict.
  const auto found = std::find_if(diagnosis.faults.begin(), diagnosis.faults.end(),
                                  [](const Fault& fault) { return fault.name == FaultName::little_overlap; });
  ASSERT_NE(found, diagnosis.faults.end());
  EXPECT_EQ(found->severity, Severity::note);
}

TEST(Faults, OfOneKindAreOneEntryWithItsPoses) {
  const Fault first{
      FaultName::odd_pose, "pose01: 3 px", "try --skip-poses pose01", Severity::note, {"pose01"}};
  const Fault second{
      FaultName::odd_pose, "pose04: 2 px", "try --skip-poses pose04", Severity::doubt, {"pose04"}};
  const Fault other{FaultName::defocus, "blurred", "focus"};
  const std::vector<Fault> found = merged({first, other, second, second});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].poses, (std::vector<std::string>{"pose01", "pose04"}));
  EXPECT_EQ(found[0].severity, Severity::doubt);
  EXPECT_EQ(to_text(found[0]),
            "odd_pose in pose01, pose04: pose01: 3 px (and 2 more of the same kind); try --skip-poses "
            "pose01,pose04.");
  EXPECT_EQ(to_text(found[1]), "defocus: blurred; focus.");
}

TEST(Faults, BoardBent) {
  FaultBench bent = bench();
  bent.sheet = [](const Vector2d& p) { return Vector3d(p.x(), p.y(), 0.004 * (1 - p.x() * p.x() / 0.04)); };
  expect_named(diagnosis_of(bent, "board bent by 4 mm"), "board_not_flat");
}

TEST(Faults, BoardTwisted) {
  FaultBench twisted = bench();
  twisted.sheet = [](const Vector2d& p) {
    return Vector3d(p.x(), p.y(), 0.004 * p.x() * p.y() / 0.2 / 0.13);
  };
  expect_named(diagnosis_of(twisted, "board twisted by 4 mm"), "board_not_flat", {"odd_pose"});
}

TEST(Faults, SquaresWiderThanHigh) {
  FaultBench stretched = bench();
  stretched.sheet = [](const Vector2d& p) { return Vector3d(1.02 * p.x(), p.y(), 0); };
  expect_named(diagnosis_of(stretched, "squares 2 % too wide"), "wrong_square_size", {"odd_pose"});
}

TEST(Faults, SquaresLargerThanInTheLastCalibration) {
  FaultBench larger = bench(4);
  const Diagnosis before = diagnosis_of(larger, "nothing, four poses");
  ASSERT_TRUE(before.solution.has_value());
  larger.sheet = [](const Vector2d& p) { return Vector3d(1.03 * p.x(), 1.03 * p.y(), 0); };
  expect_named(diagnosis_of(larger, "squares 3 % too large", &before.solution->rig), "wrong_square_size",
               {"few_poses"});
}

}  // namespace
}  // namespace limn::calib
