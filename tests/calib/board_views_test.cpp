#include "calib/board_views.h"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>

#include "calib/judge/assess.h"
#include "calib/model_selection.h"
#include "calib/report/report.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "tests/calib/photographed_board.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

const Lens k_lens =
    Lens::create("LENSMODEL_OPENCV4", {700, 700, 330, 231, -0.2, 0.06, 0.001, -0.001}).value();
const Imager k_left{"left", 640, 480, k_lens, Pose()};
const Imager k_right{"right", 640, 480, k_lens,
                     Pose(exp_rotation({0, 0.1, 0}), Eigen::Vector3d(-0.08, 0.002, 0.01))};

// Photographs of a board in `poses` places by both cameras, in one folder.
fs::path photograph(const Board& board,
                    const fs::path& folder,
                    int poses,
                    const std::vector<Imager>& cameras) {
  auto rng = test::test_rng();
  EXPECT_TRUE(make_folder(folder).ok());
  for (int index = 0; index < poses; ++index) {
    const Pose world_from_board = test::tilted_board(board, index, 0.55);
    for (const Imager& camera : cameras)
      EXPECT_TRUE(write_png(folder / fmt::format("{}{:02}.png", camera.name, index),
                            test::photographed_board(board, camera,
                                                     camera.imager_from_world * world_from_board, 1, &rng, 3))
                      .ok());
  }
  return folder;
}

Result<Observed> observed_in(const fs::path& folder, const Board& board, const std::string& shots = "*") {
  LIMN_TRY(ShotFiles found, find_photographs({.folder = folder, .shots = shots}));
  return observe_board({folder, board, found.cameras, found.poses});
}

// Root mean square distance of two lenses' pixels of the same directions, after the best rotation, over the
// image.
double difference_px(const Lens& a, const Lens& b) {
  double squared = 0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> all;
  for (int y = 40; y < 480; y += 80) {
    for (int x = 40; x < 640; x += 80) {
      all.push_back(*b.project(*a.unproject({x, y})) - Eigen::Vector2d(x, y));
      shift += all.back();
    }
  }
  shift /= static_cast<double>(all.size());  // a small rotation is almost a shift
  for (const Eigen::Vector2d& d : all) squared += (d - shift).squaredNorm();
  return std::sqrt(squared / static_cast<double>(all.size()));
}

TEST(CamerasOnly, OneLensIsFoundAsWellAsByOpenCv) {
  const Board board = Board::parse("chessboard:8x5:30mm").value();
  const fs::path folder = photograph(board, test::test_folder() / "photos", 10, {k_left});
  const auto observed = observed_in(folder, board);
  ASSERT_TRUE(observed.ok()) << observed.message();
  ASSERT_EQ(observed->observations.poses.size(), 10U);
  const auto choice = solve_selecting_models(observed->observations, {.camera_model = "LENSMODEL_OPENCV4"});
  ASSERT_TRUE(choice.ok()) << choice.message();
  std::vector<std::vector<cv::Point3f>> points(10);
  std::vector<std::vector<cv::Point2f>> px(10);
  for (const CornerObservation& corner : observed->observations.corners) {
    const Eigen::Vector3f p = board.p_corner(corner.corner).cast<float>();
    points[static_cast<size_t>(corner.pose)].emplace_back(p.x(), p.y(), 0.F);
    px[static_cast<size_t>(corner.pose)].emplace_back(static_cast<float>(corner.px.x()),
                                                      static_cast<float>(corner.px.y()));
  }
  cv::Mat k, distortion;
  std::vector<cv::Mat> rotations, translations;
  cv::calibrateCamera(points, px, {640, 480}, k, distortion, rotations, translations, cv::CALIB_FIX_K3);
  const Lens theirs = Lens::create("LENSMODEL_OPENCV4",
                                   {k.at<double>(0, 0), k.at<double>(1, 1), k.at<double>(0, 2),
                                    k.at<double>(1, 2), distortion.at<double>(0), distortion.at<double>(1),
                                    distortion.at<double>(2), distortion.at<double>(3)})
                          .value();
  const Lens& ours = choice->solution.rig.cameras[0].lens;
  const double own = difference_px(k_lens, ours), opencv = difference_px(k_lens, theirs);
  printf("[ cameras  ] off the truth by %.4f px, OpenCV by %.4f px; held-out %.4f px\n", own, opencv,
         choice->held_out.rms_px);
  EXPECT_LT(own, 0.1);
  EXPECT_LT(own, 1.5 * opencv + 0.02);
  EXPECT_NEAR(ours.fx(), 700, 1.0);
  EXPECT_LT(choice->held_out.rms_px, 0.1);
  const Assessment assessment = assess(*observed, choice->solution, choice->held_out);
  EXPECT_NE(assessment.verdict, Verdict::reject) << to_text(assessment.faults);
  ASSERT_EQ(assessment.lens_stddev_px.size(), 1U);
  EXPECT_GT(assessment.lens_stddev_px[0], own / 5);
  EXPECT_LT(assessment.lens_stddev_px[0], 0.3);
}

TEST(CamerasOnly, TwoCamerasGetTheirPosesAndARigFolderWithoutProjectors) {
  const Board board = Board::parse("acircles:4x9:25mm").value();
  const fs::path folder = photograph(board, test::test_folder() / "photos", 8, {k_left, k_right});
  fs::remove(folder / "right03.png");  // a pose of one camera
  const auto observed = observed_in(folder, board);
  ASSERT_TRUE(observed.ok()) << observed.message();
  ASSERT_EQ(observed->observations.cameras.size(), 2U);
  auto choice = solve_selecting_models(observed->observations, {.camera_model = "LENSMODEL_OPENCV4"});
  ASSERT_TRUE(choice.ok()) << choice.message();
  const Pose& right_from_left = choice->solution.rig.cameras[1].imager_from_world;
  EXPECT_LT((right_from_left.translation - k_right.imager_from_world.translation).norm(), 1e-3);
  EXPECT_LT(angle_between(right_from_left.rotation, k_right.imager_from_world.rotation), 2e-3);
  Report report{*observed, choice->solution, assess(*observed, choice->solution, choice->held_out), {}};
  report.explanation = explain(report.observed, report.solution, report.assessment);
  const fs::path rig_folder = test::test_folder() / "rig";
  ASSERT_TRUE(write_rig_folder(report, choice->options, rig_folder).ok());
  const auto rig = load_rig(rig_folder);
  ASSERT_TRUE(rig.ok()) << rig.message();
  EXPECT_EQ(rig->cameras.size(), 2U);
  EXPECT_TRUE(rig->projectors.empty());
  EXPECT_TRUE(fs::exists(rig_folder / "camera1.cameramodel"));
  const auto json = test::read_json(rig_folder / "report.json");
  EXPECT_TRUE(json["predicted_error_mm"]["p95"].is_null());
  EXPECT_LT(json["devices"][1]["lens_stddev_px"].get<double>(), 1);
  EXPECT_EQ(json["held_out"]["poses"].size(), 8U);
  EXPECT_NE(json["words"].get<std::string>().find("lens of"), std::string::npos);
}

TEST(CamerasOnly, AFolderForEachCameraGivesItsName) {
  const fs::path folder = test::test_folder();
  for (const char* name : {"front/img_1.jpg", "front/img_2.jpg", "side/img_2.jpg"}) {
    ASSERT_TRUE(make_folder((folder / name).parent_path()).ok());
    ASSERT_TRUE(write_file(folder / name, "x").ok());
  }
  const auto found = find_photographs({.folder = folder});
  ASSERT_TRUE(found.ok()) << found.message();
  EXPECT_EQ(found->cameras, (std::vector<std::string>{"front", "side"}));
  ASSERT_EQ(found->poses.size(), 2U);
  EXPECT_TRUE(found->poses[0].files[1].empty());
  EXPECT_EQ(found->poses[1].files[1].size(), 1U);
}

TEST(CamerasOnly, ProblemsAreNamed) {
  const Board board = Board::parse("chessboard:8x5:30mm").value();
  const fs::path folder = photograph(board, test::test_folder() / "photos", 2, {k_left});
  const auto other = observed_in(folder, Board::parse("chessboard:9x6:30mm").value());
  ASSERT_FALSE(other.ok());
  EXPECT_NE(other.message().find("chessboard:9x6:30mm"), std::string::npos) << other.message();
  ASSERT_TRUE(write_png(folder / "left99.png", cv::Mat(240, 320, CV_8U, cv::Scalar(99))).ok());
  const auto sizes = observed_in(folder, board);
  ASSERT_FALSE(sizes.ok());
  EXPECT_NE(sizes.message().find("left99.png: expected 640x480"), std::string::npos) << sizes.message();
  const auto none = find_photographs({.folder = folder, .shots = "x*,y*"});
  ASSERT_FALSE(none.ok());
}

}  // namespace
}  // namespace limn::calib
