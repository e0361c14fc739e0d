#include "wizard/capture/device_backend.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "apps/recheck.h"
#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/wizard/board_room.h"
#include "tests/wizard/small_plan.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/rig_recheck.h"
#include "wizard/capture/virtual_capture.h"
#include "wizard/guided_poses.h"
#include "wizard/pose_instructions.h"
#include "wizard/sequence.h"

namespace limn::wizard {
namespace {

using State = StillBoard::State;

// Corners of a board at x, displaced by `tremble` (px).
std::vector<calib::BoardCorner> corners_at(double x, double tremble) {
  std::vector<calib::BoardCorner> corners;
  for (int i = 0; i < 20; ++i)
    corners.push_back({i, {x + 40 * (i % 5) + tremble, 40.0 * (i / 5) - tremble}, 0.1});
  return corners;
}

TEST(StillBoard, IsStillWhenItRestsInANewPlace) {
  StillBoard board;
  double at_s = 0;
  const auto take = [&](double x, double tremble) {
    at_s += 1 / 30.0;
    return board.add_corners(corners_at(x, tremble), shifted(Stamp{}, at_s));
  };
  EXPECT_EQ(board.add_corners({}, Stamp{}), State::unseen);
  for (int i = 0; i < 60; ++i) EXPECT_EQ(take(2.0 * i, 0), State::moving) << i;
  int waited = 0;
  while (take(120, waited % 2 ? 0.1 : -0.1) == State::moving) ASSERT_LT(++waited, 60);
  EXPECT_NEAR(waited / 30.0, 0.8, 0.1);
  EXPECT_EQ(take(120, 0), State::still);
  board.captured();
  EXPECT_EQ(take(120, 0), State::known);
  EXPECT_EQ(take(125, 0), State::moving);
  for (int i = 0; i < 40; ++i) take(125, 0);
  EXPECT_EQ(take(125, 0), State::known) << "5 pixels away is not a new place";
  for (int i = 0; i < 40; ++i) take(190, 0);
  EXPECT_EQ(take(190, 0), State::still);
  for (int i = 0; i < 40; ++i) EXPECT_NE(take(190, i % 2 ? 1 : -1), State::still) << "the hand trembles";
}

TEST(StillRoom, RestsWhenNothingMovesForAWhile) {
  StillRoom room;
  cv::Mat noise(240, 320, CV_8UC1), image(240, 320, CV_8UC1);
  cv::RNG random(3);
  double at_s = 0;
  const auto rests_after = [&](int hand_x) {
    random.fill(noise, cv::RNG::NORMAL, 6, 2);
    image = cv::Scalar(90);
    cv::add(image, noise, image);
    if (hand_x >= 0) image(cv::Rect(hand_x, 60, 40, 40)) = cv::Scalar(180);
    at_s += 0.1;
    return room.add_image(image, shifted(Stamp{}, at_s));
  };
  for (int i = 0; i < 200; ++i) ASSERT_FALSE(rests_after(i)) << "a hand moves through the image";
  int waited = 0;
  while (!rests_after(-1)) ASSERT_LT(++waited, 100);
  EXPECT_NEAR(0.1 * waited, StillRoom::k_rest_s, 0.3);
  EXPECT_FALSE(rests_after(100));
}

TEST(DeviceBackend, CapturesWhenTheBoardIsHeldStillAndWaitsForItsDisplays) {
  const std::filesystem::path folder = test::test_folder();
  test::BoardRoom room(load_plan(test::small_plan(folder)).value());
  DeviceBackend device_backend(room.devices(), room.plan.board, nullptr);
  ImageWriter writer;
  const WizardOptions options{.out = folder / "rig"};
  const calib::CaptureSet captures =
      plan_virtual_captures(room.plan, room.rig, options.out / "captures").value();
  const auto places =
      pose_instructions(room.rig.world().rig.cameras[0], room.plan.board, room.plan.world_from_board);
  std::string lines;
  std::optional<Rig> last;  // solved from the poses so far
  const auto done = calibrate_rig(
      options, "{\"schema\": \"limn.captured_plan/1\"}", captures, places, device_backend.backend(&writer),
      {.say = [&](const std::string& line) { lines += line + "\n"; },
       .pose_begins = [&](int pose) { room.go(room.plan.world_from_board[static_cast<std::size_t>(pose)]); },
       .judged =
           [&](const PoseJudged& judged, const auto&, const auto&) {
             EXPECT_EQ(judged.rig.has_value(), judged.assessment.has_value());
             last = judged.rig;
           }});
  ASSERT_TRUE(done) << done.message();
  EXPECT_EQ(room.moved, 0) << "patterns shown while the board moved";
  EXPECT_EQ(done->report.assessment.verdict, calib::Verdict::good) << lines;
  ASSERT_EQ(done->latency_s.size(), 1U) << lines;
  EXPECT_NEAR(done->latency_s[0].second, 0.12, 0.0025);
  ASSERT_TRUE(last);
  EXPECT_NEAR(last->cameras[0].lens.fx(), room.rig.world().rig.cameras[0].lens.fx(), 10);

  // A recheck with the same devices of whatever stands there.
  const Rig rig = load_rig(options.out).value();
  const calib::CaptureSet again =
      calib::plan_captures(folder / "again", captures.cameras, captures.projectors, captures.board,
                           calib::PatternCode::gray, {.inverses = false});
  const Stamp before = room.rig.now();
  const Status taken = capture_once(again, rig, device_backend.backend(&writer));
  ASSERT_TRUE(taken) << taken.message();
  EXPECT_LT(seconds_between(before, room.rig.now()), 15);
  const auto checked =
      apps::recheck({.rig = options.out, .captures = again.folder, .out = folder / "checked"});
  ASSERT_TRUE(checked) << checked.message();
  EXPECT_EQ(checked->result.verdict, calib::RigVerdict::sound);
}

// The poses were planned for an assumed lens. A board that is held on the planned outline is in another pose,
// which follows from the rig; from this pose the outlines in the other cameras are predicted.
TEST(GuidedPoses, AreShownToAllCamerasOnceThereIsARig) {
  const calib::Board board = calib::Board::parse("charuco:11x8:25mm").value();
  const Imager assumed = assumed_camera("camera0", 1280, 1024);
  const std::vector<Pose> planned = guided_poses(assumed, board);
  Rig rig;
  const double f = 1.3 * assumed.lens.fx();
  const Lens lens =
      Lens::create("LENSMODEL_OPENCV8", {f, f, 650, 500, -0.1, 0.05, 0.001, 0, 0, 0, 0, 0}).value();
  rig.cameras.push_back({"camera0", 1280, 1024, lens, Pose()});
  rig.cameras.push_back(rig.cameras[0]);
  rig.cameras[1].name = "camera1";
  rig.cameras[1].imager_from_world = Pose(exp_rotation({0, 0.4, 0}), {-0.4, 0.02, 0.1});
  const std::vector<Pose> places = placed_alike(planned, board, assumed, rig);
  const auto wanted = outlines(board, planned, {assumed}), shown = outlines(board, places, rig.cameras);
  ASSERT_EQ(shown.size(), planned.size());
  for (std::size_t i = 0; i < shown.size(); ++i) {
    ASSERT_EQ(shown[i].size(), 2U);
    ASSERT_EQ(shown[i][0].size(), 4U) << i;
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_LT((shown[i][0][k] - wanted[i][0][k]).norm(), 25) << i << " " << k;
    EXPECT_GT(places[i].translation.norm(), 1.15 * planned[i].translation.norm())
        << "farther away, and as large in the image";
    // The other camera's outline is that of the board in this pose.
    ASSERT_EQ(shown[i][1].size(), 4U) << i;
    const auto px = rig.cameras[1].project(places[i] * Eigen::Vector3d(board.width_m(), board.height_m(), 0));
    EXPECT_LT((shown[i][1][2] - *px).norm(), 1e-6);
    EXPECT_GT((shown[i][1][2] - shown[i][0][2]).norm(), 20);
  }
  // There is no outline if the board is behind the camera.
  rig.cameras[1].imager_from_world = Pose(exp_rotation({0, 3.1, 0}), {0, 0, 0});
  for (const auto& cameras : outlines(board, places, rig.cameras)) EXPECT_TRUE(cameras[1].empty());
}

TEST(GuidedPoses, AreSeenWholeAndTiltedToAllSides) {
  const calib::Board board = calib::Board::parse("charuco:11x8:25mm").value();
  for (const cv::Size size : {cv::Size(1280, 1024), cv::Size(1920, 1080), cv::Size(640, 480)}) {
    const Imager camera = assumed_camera("camera0", size.width, size.height);
    const std::vector<Pose> poses = guided_poses(camera, board);
    ASSERT_GE(poses.size(), 10U);
    double least[2] = {1, 1}, most[2] = {-1, -1};
    for (std::size_t i = 0; i < poses.size(); ++i) {
      for (const auto& [x, y] : {std::pair(0.0, 0.0),
                                 {board.width_m(), 0.0},
                                 {0.0, board.height_m()},
                                 {board.width_m(), board.height_m()}}) {
        const auto px = camera.project(poses[i] * Eigen::Vector3d(x, y, 0));
        EXPECT_TRUE(px && camera.contains(*px)) << i << " at " << size;
      }
      const Eigen::Vector3d n = poses[i].rotation * Eigen::Vector3d::UnitZ();
      for (int axis = 0; axis < 2; ++axis) {
        least[axis] = std::min(least[axis], n[axis]);
        most[axis] = std::max(most[axis], n[axis]);
      }
    }
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_LT(least[axis], -0.3);
      EXPECT_GT(most[axis], 0.3);
    }
  }
}

}  // namespace
}  // namespace limn::wizard
