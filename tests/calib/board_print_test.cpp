#include "calib/board_print.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calib/judge/assess.h"
#include "calib/judge/scale_bar.h"
#include "calib/model_selection.h"
#include "calib/solve.h"
#include "tests/calib/bad_print.h"
#include "tests/calib/true_rig.h"
#include "tests/support/matchers.h"

namespace limn::test {
namespace {

using calib::BoardMeasured;
using Eigen::Vector2d;

constexpr double k_pnp_px = 0.02;
constexpr double k_bend_m = 0.4e-3;

struct Printed {
  TrueRig truth;
  calib::Observations observations;
};

Printed printed(const BadPrint& print, unsigned seed, std::mt19937_64* rng, bool has_turns = false) {
  Printed made;
  made.truth = make_true_rig({.k1 = -0.05,
                              .shift = 0.5,
                              .poses = 12,
                              .square_pixels = true,
                              .quarter_turns = has_turns,
                              .seed = seed});
  made.truth.bow_m = {k_bend_m, 0};
  made.truth.twist_m = k_bend_m;
  made.observations = observed_perfectly(made.truth, 4);
  print_corners(made.truth, print, &made.observations);
  add_noise(0.015, 0.03, rng, &made.observations);
  for (calib::Match& match : made.observations.matches) match.stddev_px = 0.03;
  return made;
}

struct Judged {
  Landed landed;
  double stated_mm = 0;
  calib::Assessment assessment;
};

Judged judged(const Printed& made, const calib::SolveOptions& options, std::mt19937_64* rng) {
  const auto solution = calib::solve(made.observations, options);
  EXPECT_TRUE(solution.ok()) << solution.message();
  Judged result;
  result.assessment = calib::assess({made.observations, {}, {}, 0, 0}, options, *solution).value();
  result.stated_mm = result.assessment.predicted_error_mm[0];
  result.landed = landed(made.truth, solution->rig, prototype_mesh(Prototype::panel), k_pnp_px, 400, rng);
  return result;
}

TEST(BoardPrint, SmoothModesHaveUnitRmsAndLengthsFollowTheSizes) {
  const calib::Board board = calib::Board::parse("charuco:10x7:25mm").value();
  Eigen::Matrix<double, calib::k_print_modes, 1> squares;
  squares.setZero();
  constexpr int k_side = 200;
  for (int i = 0; i < k_side * k_side; ++i) {
    const Vector2d p((i % k_side + 0.5) / k_side * board.width_m(),
                     (i / k_side + 0.5) / k_side * board.height_m());
    squares += calib::print_modes(board, p).cwiseAbs2().colwise().sum().transpose() / (k_side * k_side);
  }
  for (int i = 3; i < calib::k_print_modes; ++i) EXPECT_NEAR(squares[i], 1, 1e-3) << i;
  EXPECT_TRUE(near(calib::nominal_lengths(board), Vector2d(0.2, 0.125), 1e-12));
  Eigen::VectorXd print = Eigen::VectorXd::Zero(calib::k_print_modes);
  print[0] = 0.001 * board.width_m() / 2;  // 0.1 % wider
  EXPECT_TRUE(near(Vector2d(calib::by_print(board) * print), Vector2d(0.0002, 0), 1e-9));
}

TEST(BoardPrint, MeasuredSizesAreReadAndChecked) {
  const auto read = calib::parse_board_measured("225.2x149.9mm:0.05");
  ASSERT_TRUE(read.ok()) << read.message();
  EXPECT_NEAR(read->width_m, 0.2252, 1e-12);
  EXPECT_NEAR(read->height_m, 0.1499, 1e-12);
  EXPECT_NEAR(read->stddev_m, 5e-5, 1e-12);
  EXPECT_NEAR(calib::parse_board_measured("225x150mm")->stddev_m, 1e-4, 1e-12);
  for (const char* text : {"", "225.2", "225.2x149.9", "225.2x149.9cm", "-1x3mm", "225x150mm:0",
                           "225x150mm:x", "0x150mm", "225x150mm:50"})
    EXPECT_FALSE(calib::parse_board_measured(text).ok()) << text;
  const calib::Board board = calib::Board::parse("charuco:10x7:25mm").value();
  EXPECT_TRUE(calib::check_measured(board, {0.2003, 0.1249}).ok());
  const auto message = [&](double width, double height) {
    return calib::check_measured(board, {width, height}).message();
  };
  EXPECT_NE(message(0.125, 0.2).find("swapped"), std::string::npos);
  EXPECT_NE(message(0.02, 0.0125).find("in cm"), std::string::npos);
  EXPECT_NE(message(0.25, 0.175).find("200.00 x 125.00 mm"), std::string::npos);
}

TEST(BoardPrint, LengthsMakeUpForABadPrint) {
  std::mt19937_64 rng = test_rng();
  for (const double stddev_m : {0.03e-3, 0.1e-3}) {
    std::vector<double> place, moved, turned, ratios, without;
    for (unsigned seed = 1; seed <= 4; ++seed) {
      const BadPrint print{.phase = 0.9 * seed};
      const Printed made = printed(print, seed, &rng);
      std::normal_distribution<double> error(0, stddev_m);
      const Vector2d lengths = print.lengths(made.truth.board) + Vector2d(error(rng), error(rng));
      const Judged with = judged(
          made, {.board_measured = BoardMeasured{lengths.x(), lengths.y(), stddev_m}, .square_pixels = true},
          &rng);
      for (const double e : with.landed.in_place_mm) place.push_back(e);
      for (const double e : with.landed.moved_mm) moved.push_back(e);
      for (const double e : with.landed.turned_mm) turned.push_back(e);
      for (const double e : with.landed.pooled_mm()) ratios.push_back(e / with.stated_mm);
      for (const double e : judged(made, {}, &rng).landed.pooled_mm()) without.push_back(e);
    }
    printf(
        "[ print    ] lengths to %.2f mm: %.3f/%.3f/%.3f mm RMS, holds for %.1f %%; without lengths %.3f "
        "mm\n",
        1e3 * stddev_m, rms(place), rms(moved), rms(turned), 100 * share_within(ratios, 1), rms(without));
    const double limit = stddev_m < 0.05e-3 ? 0.08 : 0.15;
    EXPECT_LT(rms(place), limit);
    EXPECT_LT(rms(moved), std::max(limit, 0.10));
    EXPECT_LT(rms(turned), limit);
    EXPECT_GT(share_within(ratios, 1), 0.85);  // four rigs
    EXPECT_GT(rms(without), 1.5 * rms(moved));
  }
}

// Boards in quarter turns show the print in the corners' residuals, others in the shape of the pixels.
TEST(BoardPrint, AnUnevenPrintShowsWithoutLengthsAndUnevenPixelsAreNotTakenForOne) {
  std::mt19937_64 rng = test_rng();
  for (const bool has_turns : {false, true}) {
    std::vector<double> ratios, solved, exact;
    for (unsigned seed = 1; seed <= 4; ++seed) {
      const Printed made = printed({.phase = 0.9 * seed}, seed, &rng, has_turns);
      const calib::Solution plain = calib::solve(made.observations).value();
      const calib::UnevenPrint uneven = calib::uneven_print(made.observations, {}, plain);
      EXPECT_GT(uneven.size, 0.0006);  // 0.0015 by its size alone; the smooth errors grow it or shrink it
      EXPECT_LT(uneven.size, 0.004);
      EXPECT_TRUE(uneven.are_pixels_square);
      const Judged with = judged(made, {.print_size = uneven.size, .square_pixels = true}, &rng);
      for (const double e : with.landed.pooled_mm()) {
        ratios.push_back(e / with.stated_mm);
        solved.push_back(e);
      }
      for (const double e : judged(made, {}, &rng).landed.pooled_mm()) exact.push_back(e);
      EXPECT_TRUE(std::any_of(with.assessment.faults.begin(), with.assessment.faults.end(),
                              [](const calib::Fault& f) {
                                return f.name == calib::FaultName::uneven_print &&
                                       f.severity == calib::Severity::doubt;
                              }))
          << calib::to_text(with.assessment.faults);
    }
    printf("[ print    ] without lengths: %.3f mm RMS, as an exact board %.3f mm; stated holds for %.1f %%\n",
           rms(solved), rms(exact), 100 * share_within(ratios, 1));
    EXPECT_GT(share_within(ratios, 1), 0.9);
    EXPECT_LT(rms(solved), rms(exact));
  }
}

// A known length, of 250 mm to 0.05 mm, beside a print whose mean size nobody measured.
TEST(BoardPrint, AKnownLengthMakesUpForTheSizeOfABadPrint) {
  std::mt19937_64 rng = test_rng();
  constexpr double k_stddev = 2e-4;
  constexpr std::array k_errors = {0.32, -1.15, 1.15,
                                   -0.32};  // the middles of a normal distribution's quarters
  std::vector<double> with, without, ratios;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const BadPrint print{.phase = 0.9 * seed};
    const Printed made = printed(print, seed, &rng);
    const Vector2d sizes =
        print.lengths(made.truth.board).cwiseQuotient(calib::nominal_lengths(made.truth.board));
    const calib::PrintGrowth growth{sizes.mean() - 1 + k_errors[seed - 1] * k_stddev, k_stddev};
    const Judged known = judged(made, {.known_growth = growth, .square_pixels = true}, &rng);
    for (const double e : known.landed.pooled_mm()) {
      with.push_back(e);
      ratios.push_back(e / known.stated_mm);
    }
    for (const double e : judged(made, {}, &rng).landed.pooled_mm()) without.push_back(e);
  }
  printf("[ print    ] size to %.2f %%: %.3f mm RMS, holds for %.1f %%; without %.3f mm\n", 100 * k_stddev,
         rms(with), 100 * share_within(ratios, 1), rms(without));
  EXPECT_LT(rms(with), 0.5 * rms(without));
  EXPECT_GT(share_within(ratios, 1), 0.9);
}

TEST(BoardPrint, KnownLengthsShowTheSizeOfThePrintByTheirDeviations) {
  const auto seen = [](double length_m, double measured_m, double stddev_m) {
    calib::ScaleBarCheck check;
    check.known = {"a:1", "a:2", length_m, 1e-6};
    check.views.resize(1);
    check.measured_m = measured_m;
    check.stddev_m = stddev_m;
    return check;
  };
  EXPECT_FALSE(calib::growth_by_lengths({calib::ScaleBarCheck()}, 0).has_value());
  // The rig shows 100 mm as 99.8: the print is larger by 0.2 % than the rig takes it for.
  const auto one = calib::growth_by_lengths({seen(0.1, 0.0998, 1e-4)}, 0.001);
  ASSERT_TRUE(one.has_value());
  EXPECT_NEAR(one->mean, 0.003, 1e-5);
  EXPECT_NEAR(one->stddev, 1e-3, 2e-5);
  const auto both = calib::growth_by_lengths({seen(0.1, 0.0998, 1e-4), seen(0.2, 0.1998, 1e-4)}, 0);
  ASSERT_TRUE(both.has_value());
  EXPECT_NEAR(both->mean, (0.002 + 4 * 0.001) / 5, 1e-5);
  EXPECT_NEAR(both->stddev, 1e-3 / std::sqrt(5.0), 2e-5);
  const auto torn = calib::growth_by_lengths({seen(0.1, 0.099, 1e-4), seen(0.1, 0.101, 1e-4)}, 0);
  ASSERT_TRUE(torn.has_value());
  EXPECT_NEAR(torn->stddev, 1e-2, 1e-3);  // they differ by ten times what they state
}

TEST(BoardPrint, ALengthIsBelievedWhereAPrintMayBeSoWrong) {
  const calib::Board board = calib::Board::parse("charuco:10x7:25mm").value();
  const calib::PrintGrowth nobody = calib::expected_growth(board, std::nullopt),
                           by_hand = calib::expected_growth(board, BoardMeasured{0.2002, 0.1251, 5e-5});
  EXPECT_NEAR(nobody.stddev, 0.003 / std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(by_hand.mean, (0.001 + 0.0008) / 2, 1e-9);
  EXPECT_TRUE(calib::may_be_growth(nobody, {0.008, 1e-4}));
  EXPECT_FALSE(calib::may_be_growth(nobody, {-0.03, 1e-3}));
  EXPECT_TRUE(calib::may_be_growth(by_hand, {0.002, 1e-4}));
  EXPECT_FALSE(calib::may_be_growth(by_hand, {0.006, 1e-4}));
}

TEST(BoardPrint, ABoardGluedFromTwoSheetsIsNamed) {
  std::mt19937_64 rng = test_rng();
  for (const double step_m : {0.0, 0.4e-3, 1e-3}) {
    const Printed made = printed({.aspect = 0, .smooth_m = 0.05e-3, .step_m = step_m}, 3, &rng);
    const calib::Solution plain = calib::solve(made.observations).value();
    const calib::UnevenPrint uneven = calib::uneven_print(made.observations, {}, plain);
    const Judged judgement = judged(made, {.print_size = uneven.size}, &rng);
    const auto& faults = judgement.assessment.faults;
    const auto named = std::find_if(faults.begin(), faults.end(), [](const calib::Fault& f) {
      return f.evidence.find("two sheets: from about its column ") != std::string::npos;
    });
    EXPECT_EQ(named != faults.end(), step_m > 0) << step_m << ": " << calib::to_text(faults);
  }
}

// A sheet that lies differently in each of five poses: its corners fit better with a print's errors, too.
TEST(BoardPrint, WhatPredictsNoOtherPoseIsNotTakenForABadPrint) {
  std::mt19937_64 rng = test_rng();
  constexpr int k_poses = 5;
  const TrueRig truth =
      make_true_rig({.k1 = -0.05, .shift = 0.5, .poses = k_poses, .square_pixels = true, .seed = 4});
  for (const bool is_print : {true, false}) {
    calib::Observations observations = observed_perfectly(truth, 4);
    std::vector<calib::CornerObservation> corners;
    for (int pose = 0; pose < k_poses; ++pose) {
      calib::Observations one = observations;
      std::erase_if(one.corners, [&](const calib::CornerObservation& seen) { return seen.pose != pose; });
      print_corners(truth, {.aspect = 0, .phase = is_print ? 4 : 4 + 5.2 * pose}, &one);
      corners.insert(corners.end(), one.corners.begin(), one.corners.end());
    }
    observations.corners = corners;
    add_noise(0.03, 0.05, &rng, &observations);
    const calib::ModelSelection plain = calib::solve_selecting_models(observations).value();
    EXPECT_GT(calib::uneven_print(observations, plain.options, plain.solution).size, 0);
    const calib::ModelSelection chosen = calib::solve_uneven_print(observations, plain).value();
    printf("[ print    ] %s: held-out error %.3f px, then %.3f px\n", is_print ? "print" : "sheet",
           plain.held_out.rms_px, chosen.held_out.rms_px);
    EXPECT_EQ(chosen.solution.print.size() > 0, is_print);
  }
}

TEST(BoardPrint, AnExactBoardIsNotTakenForABadPrint) {
  std::mt19937_64 rng = test_rng();
  for (const bool is_square : {false, true}) {  // otherwise its pixels are 0.13 % uneven
    for (const bool has_turns : {false, true}) {
      const TrueRig truth = make_true_rig(
          {.k1 = -0.05, .shift = 0.5, .square_pixels = is_square, .quarter_turns = has_turns, .seed = 5});
      calib::Observations observations = observed_perfectly(truth, 4);
      add_noise(0.015, 0.03, &rng, &observations);
      EXPECT_EQ(calib::uneven_print(observations, {}, calib::solve(observations).value()).size, 0);
    }
  }
}

}  // namespace
}  // namespace limn::test
