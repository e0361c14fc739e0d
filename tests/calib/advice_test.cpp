#include "calib/report/advice.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace worlds;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Advice for a world whose solution is the truth and whose numbers are given, so that no solve is needed.
struct Judged {
  World world = make_world(1, 2, 9, 0.0);
  Assessment assessment;

  Judged() {
    assessment.verdict = Verdict::usable;
    assessment.held_out.rms_px = 0.4;
    assessment.held_out.poses = {{"pose0", 0.3, 10}, {"pose7", 0.61, 10}};
    assessment.predicted_error_mm = assessment.held_out_error_mm =
        assessment.propagated_error_mm = {0.8, 1.4};
  }
  Explanation words() const {
    Solution solution;
    solution.rig = world.rig;
    for (const Pose& pose : world.world_from_board) solution.world_from_board.emplace_back(pose);
    return explain({world.observations, {}, {}}, solution, assessment);
  }
};

bool says(const Explanation& words, const std::string& text) {
  return std::any_of(words.advice.begin(), words.advice.end(),
                     [&](const std::string& sentence) { return sentence.find(text) != std::string::npos; });
}

TEST(Advice, NamesTheEdgesThatNobodySaw) {
  Judged judged;
  // The two projectors' matches are everywhere; then those of projector1 near its left edge are removed.
  auto& matches = judged.world.observations.matches;
  for (int i = 0; i < 400; ++i) {
    const Vector2d px(1280 * (i % 20 + 0.5) / 20, 800 * (i / 20 + 0.5) / 20);
    for (const int projector : {0, 1}) matches.push_back({0, projector, i % 9, {600, 500}, px, 0.02, 100});
  }
  EXPECT_FALSE(says(judged.words(), "projector1: add poses"));
  std::erase_if(matches, [](const Match& m) { return m.projector == 1 && m.px_projector.x() < 320; });
  EXPECT_TRUE(says(judged.words(), "projector1: add poses near its left edge."));
  EXPECT_FALSE(says(judged.words(), "projector0: add poses"));
  std::erase_if(matches, [](const Match& m) { return m.projector == 1 && m.px_projector.y() > 600; });
  EXPECT_TRUE(says(judged.words(), "projector1: add poses near its left and lower edges."));
}

TEST(Advice, NamesTheAxisAboutWhichBoardsWereNotTilted) {
  Judged judged;
  EXPECT_FALSE(says(judged.words(), "Tilt the board more"));
  for (size_t i = 0; i < judged.world.world_from_board.size(); ++i)  // about the horizontal axis only
    judged.world.world_from_board[i].rotation = exp_rotation({0.12 * static_cast<double>(i) - 0.5, 0, 0});
  EXPECT_TRUE(says(judged.words(), "Tilt the board more about the vertical axis"));
  EXPECT_FALSE(says(judged.words(), "about the horizontal axis"));
}

TEST(Advice, AsksForDistancesAndPosesThatAreMissing) {
  Judged judged;
  EXPECT_FALSE(says(judged.words(), "nearer and some farther"));
  EXPECT_FALSE(says(judged.words(), "more poses"));
  judged.world.world_from_board.resize(5);
  EXPECT_TRUE(says(judged.words(), "Add 3 more poses"));
  Judged fine = judged;
  fine.assessment.verdict = Verdict::good;
  EXPECT_TRUE(says(fine.words(), "Add 3 more poses")) << "0.8 and 1.4 mm";
  fine.assessment.predicted_error_mm = {0.1, 0.2};
  EXPECT_FALSE(says(fine.words(), "more poses"));
  for (Pose& pose : judged.world.world_from_board) pose = Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.3});
  EXPECT_TRUE(says(judged.words(), "between 1.30 and 1.30 m"));
}

TEST(Advice, SendsTheBoardWhereTheErrorGrows) {
  Judged judged;
  const auto plane = [](double depth, double mm) {
    return ErrorMap::Plane{depth, std::vector<double>(12, mm)};
  };
  ErrorMap map;
  map.projector = 1;
  map.columns = 4;
  map.rows = 3;
  map.planes = {plane(0.9, 0.5), plane(1.1, 0.6), plane(1.5, 0.9)};
  judged.assessment.error_maps = {map};
  EXPECT_FALSE(says(judged.words(), "capture poses farther"));
  map.planes.back().p95_mm[4] = 2.5;
  judged.assessment.error_maps = {map};
  EXPECT_TRUE(says(judged.words(), "projector1: capture poses farther away, at about 1.50 m"));
  EXPECT_NE(judged.words().verdict.find("(2.50 mm at worst, 1.50 m from camera0, left of its image)"),
            std::string::npos)
      << judged.words().verdict;
}

TEST(Advice, TheVerdictNamesProjectorPoseAndReason) {
  Judged judged;
  const std::string words = judged.words().verdict;
  EXPECT_EQ(words.rfind("usable: predicted error 1.40 mm on projector1", 0), 0U) << words;
  EXPECT_NE(words.find("(pose7) 0.61 px"), std::string::npos) << words;
  EXPECT_NE(words.find("the predicted error is above 1 mm, the limit of good"), std::string::npos) << words;
  judged.assessment.faults = {{FaultName::odd_pose, "pose03", ""},
                              {FaultName::odd_pose, "pose04", ""},
                              {FaultName::board_not_flat, "bent", "flatten it"}};
  EXPECT_NE(judged.words().verdict.find("faults were found: odd_pose and board_not_flat"), std::string::npos)
      << judged.words().verdict;
  judged.assessment.predicted_error_mm = {0.8, 0.9};
  judged.assessment.held_out_error_mm = {0.05, 0.05};
  EXPECT_NE(judged.words().verdict.find("the boards do not determine the accuracy"), std::string::npos);
  judged.assessment.verdict = Verdict::good;
  EXPECT_EQ(judged.words().verdict.find("Why not better"), std::string::npos);
  judged.assessment.predicted_error_mm[1] = std::numeric_limits<double>::infinity();
  EXPECT_NE(judged.words().verdict.find("the error of projector1 is unknown"), std::string::npos);
}

TEST(Advice, WarnsWhereStatedDeviationsAreTooSmall) {
  Judged judged;
  EXPECT_FALSE(says(judged.words(), "Trust the held-out errors"));
  judged.assessment.normalised_residuals.held_out.stddev = 2.0;
  EXPECT_TRUE(says(judged.words(), "2.0 times as large as the noise explains"));
}

TEST(ErrorMap, IsReadBetweenItsCells) {
  ErrorMap map{.projector = 0, .columns = 4, .rows = 2, .planes = {}};
  for (const double depth_m : {1.0, 2.0}) {
    map.planes.push_back({depth_m, {}});
    for (int i = 0; i < 8; ++i) map.planes.back().p95_mm.push_back(depth_m + i % 4 + 10.0 * (i / 4));
  }
  EXPECT_DOUBLE_EQ(map.at({0.125, 0.25}, 1), 1);
  EXPECT_DOUBLE_EQ(map.at({0.375, 0.75}, 2), 13);
  EXPECT_DOUBLE_EQ(map.at({0.25, 0.5}, 1.5), 7);
  EXPECT_DOUBLE_EQ(map.at({0, 0}, 0.1), 1) << "outside the map, the value at its edge";
  EXPECT_DOUBLE_EQ(map.at({1, 1}, 9), 15);
  map.planes[0].p95_mm[0] = std::nan("");
  EXPECT_DOUBLE_EQ(map.at({0.25, 0.25}, 1), 2) << "from the known neighbours";
  EXPECT_TRUE(std::isnan(map.at({0.125, 0.25}, 1)));
}

}  // namespace
}  // namespace limn::calib
