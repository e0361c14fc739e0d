#include "core/constellation.h"

#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/seen_balls.h"

namespace limn::tracker {
namespace {

// The message of a constellation of these places (mm).
std::string problem_of(const std::vector<Eigen::Vector3d>& p_mm, double radius_mm = 20) {
  Constellation constellation{"wand", 1e-3 * radius_mm, {}};
  for (const Eigen::Vector3d& p : p_mm) constellation.p_balls.push_back(1e-3 * p);
  const Status status = check_constellation(constellation);
  return status ? "" : status.message();
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(Constellation, DifferentOnesAreAccepted) {
  const std::vector<Constellation> all = {test::triangle(), test::other_triangle(), test::five_balls()};
  for (const Constellation& one : all) {
    const Status status = check_constellation(one);
    EXPECT_TRUE(status) << status.message();
  }
  const Status status = check_distinct(all);
  EXPECT_TRUE(status) << status.message();
}

TEST(Constellation, CollinearBallsAreRefused) {
  EXPECT_TRUE(has(problem_of({{0, 0, 0}, {70, 0, 0}, {180, 0, 0}}), "not on a line"));
  EXPECT_TRUE(has(problem_of({{0, 0, 0}, {70, 15, 0}, {180, 0, 0}, {120, -10, 0}}), "not on a line"));
  EXPECT_EQ(problem_of({{0, 0, 0}, {70, 45, 0}, {180, 0, 0}}), "");
}

TEST(Constellation, SymmetryIsRefusedAndSaysWhichBalls) {
  const std::string isosceles = problem_of({{0, 0, 0}, {180, 0, 0}, {88, 120, 0}});
  EXPECT_TRUE(has(isosceles, "balls 0, 1, 2 lie as balls 1, 0, 2 do")) << isosceles;
  // A square with one ball beside it: the square's four balls alone are alike in any order.
  EXPECT_TRUE(has(problem_of({{0, 0, 0}, {150, 0, 0}, {150, 150, 0}, {0, 150, 0}, {60, 40, 90}}), "lie as"));
  // Distances that differ by 4 % are alike, by 8 % are not.
  EXPECT_TRUE(has(problem_of({{0, 0, 0}, {150, 0, 0}, {0, 156, 0}}), "lie as"));
  EXPECT_EQ(problem_of({{0, 0, 0}, {150, 0, 0}, {0, 163, 0}}), "");
}

// Four balls and a plane of symmetry: their distances can be exchanged, but no motion does it.
TEST(Constellation, MirrorImagesAreNotTheSame) {
  EXPECT_EQ(problem_of({{0, 0, 0}, {200, 0, 0}, {110, 60, 90}, {110, 60, -90}}), "");
}

TEST(Constellation, BallsThatOverlapAndTooFewAreRefused) {
  EXPECT_TRUE(has(problem_of({{0, 0, 0}, {30, 0, 0}, {0, 150, 0}}), "balls 0 and 1 30.0 mm"));
  EXPECT_TRUE(has(problem_of({{0, 0, 0}, {100, 0, 0}}), "expected 3 to 12 balls, found 2"));
}

TEST(Constellation, AlikeOnesAreRefusedAndNamed) {
  Constellation turned = test::triangle();
  turned.name = "turned";
  const Pose pose(exp_rotation({0.3, 2, 0.4}), {1, 2, 3});
  for (Eigen::Vector3d& p : turned.p_balls) p = pose * p;
  std::swap(turned.p_balls[0], turned.p_balls[2]);
  const Status status = check_distinct(std::vector{test::triangle(), test::other_triangle(), turned});
  ASSERT_FALSE(status);
  EXPECT_TRUE(has(status.message(), "'triangle' and 'turned'")) << status.message();
  EXPECT_TRUE(has(status.message(), "balls 0, 1, 2 of 'triangle' lie as balls 2, 1, 0")) << status.message();
  // A triangle that is part of five balls would be seen in them.
  Constellation part = test::five_balls();
  part.name = "part";
  part.p_balls = {part.p_balls[4], part.p_balls[1], part.p_balls[2]};
  EXPECT_FALSE(check_distinct(std::vector{test::five_balls(), part}));
  EXPECT_FALSE(check_distinct(std::vector{test::triangle(), test::triangle()}));
}

TEST(Constellation, AFileIsReadAndItsMistakesAreNamed) {
  const auto path = test::test_folder() / "wand.json";
  const auto load = [&](const std::string& text) {
    EXPECT_TRUE(write_file(path, text));
    return load_constellation(path);
  };
  const std::string start = R"({"schema": "limn.constellation/1", "name": "wand", )";
  const auto good = load(start + R"("ball_diameter_mm": 38, "balls_mm": [[0,0,0], [200,0,0], [80,130,5]]})");
  ASSERT_TRUE(good) << good.message();
  EXPECT_EQ(good->name, "wand");
  EXPECT_DOUBLE_EQ(good->radius_m, 0.019);
  EXPECT_TRUE(test::near(good->p_balls[2], Eigen::Vector3d(0.08, 0.13, 0.005), 1e-12));
  const auto message = [&](const std::string& rest) {
    const auto read = load(start + rest);
    return read ? std::string() : read.message();
  };
  EXPECT_TRUE(has(message(R"("ball_diameter_mm": -1, "balls_mm": []})"), "wand.json: ball_diameter_mm"));
  EXPECT_TRUE(has(message(R"("ball_diameter_mm": 0.038, "balls_mm": []})"), "found 0.038"));
  EXPECT_TRUE(has(message(R"("ball_diameter_mm": 38, "balls_mm": [[0,0,0],[1,2]]})"), "balls_mm[1]"));
  EXPECT_TRUE(has(message(R"("ball_diameter_mm": 38, "balls": []})"), "balls"));
  EXPECT_TRUE(has(message(R"("ball_diameter_mm": 38, "balls_mm": [[0,0,0],[90,0,0],[180,0,0]]})"),
                  "wand.json: balls_mm: constellation 'wand'"));
}

}  // namespace
}  // namespace limn::tracker
