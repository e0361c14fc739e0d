#include "core/least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "tests/support/matchers.h"

namespace limn {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();
constexpr double k_infinity = std::numeric_limits<double>::infinity();

// Rosenbrock's valley as least squares: 10 (y - x^2) and 1 - x, zero at (1, 1).
struct Valley {
  Vector2d state{-1.2, 1};
  std::function<bool(const Vector2d&)> is_forbidden = [](const Vector2d&) { return false; };
  double forbidden_cost = k_nan;
  double settled_gain = 1e-20;

  Vector2d trial, step, gradient;
  Matrix2d matrix;
  double cost_here = residuals(state).squaredNorm();
  int linearised = 0;
  std::vector<double> dampings, costs = {cost_here};  // `costs` are those of the accepted states

  static Vector2d residuals(const Vector2d& p) { return {10 * (p.y() - p.x() * p.x()), 1 - p.x()}; }
  double cost() const { return cost_here; }
  bool linearise() {
    ++linearised;
    Matrix2d jacobian;
    jacobian << -20 * state.x(), 10, -1, 0;
    matrix = jacobian.transpose() * jacobian;
    gradient = jacobian.transpose() * residuals(state);
    return true;
  }
  bool solve(double damping) {
    dampings.push_back(damping);
    step = -damped(matrix, damping).ldlt().solve(gradient);
    return step.allFinite();
  }
  double evaluate_trial() {
    trial = state + step;
    return is_forbidden(trial) ? forbidden_cost : residuals(trial).squaredNorm();
  }
  void accept_trial() {
    state = trial;
    cost_here = residuals(state).squaredNorm();
    costs.push_back(cost_here);
  }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && tried.gain() < settled_gain;
  }
};

TEST(LeastSquares, FollowsRosenbrocksValleyToItsEnd) {
  Valley valley;
  const LeastSquaresSummary found = minimise(&valley, {});
  EXPECT_EQ(found.end, LeastSquaresEnd::settled);
  EXPECT_LT((valley.state - Vector2d(1, 1)).norm(), 1e-9);
  EXPECT_EQ(found.cost, valley.cost_here);
  EXPECT_EQ(found.steps, static_cast<int>(valley.dampings.size()));
  EXPECT_GT(found.steps, 3) << "the valley is curved, so one step cannot be enough";
}

TEST(LeastSquares, TheCostNeverRises) {
  Valley valley;
  minimise(&valley, {});
  for (std::size_t i = 1; i < valley.costs.size(); ++i) EXPECT_LE(valley.costs[i], valley.costs[i - 1]);
  // Some steps must have been rejected, otherwise the test proves nothing.
  EXPECT_LT(valley.costs.size() - 1, valley.dampings.size());
}

TEST(LeastSquares, LinearisesOnceForEachStateThatAStepStartsFrom) {
  Valley valley;
  minimise(&valley, {});
  EXPECT_EQ(valley.linearised, static_cast<int>(valley.costs.size()) - 1);
}

TEST(LeastSquares, AnAcceptedStepDividesTheDampingByTenAndAVainOneMultipliesIt) {
  Valley valley;
  minimise(&valley, {.first_damping = 1e-2, .least_damping = 1e-5});
  EXPECT_EQ(valley.dampings.front(), 1e-2);
  int falls = 0, rises = 0;
  for (std::size_t i = 1; i < valley.dampings.size(); ++i) {
    const double before = valley.dampings[i - 1], now = valley.dampings[i];
    EXPECT_GE(now, 1e-5);
    if (now == std::max(before / 10, 1e-5))
      ++falls;
    else if (now == before * 10)
      ++rises;
    else
      ADD_FAILURE() << "from " << before << " to " << now;
  }
  EXPECT_GT(falls, 0);
  EXPECT_GT(rises, 0);
}

TEST(LeastSquares, AVainStepRaisesTheDampingFromALeastValue) {
  Valley valley;
  minimise(&valley, {.first_damping = 1e-10, .raised_from = 1e-3});
  for (std::size_t i = 1; i < valley.dampings.size(); ++i)
    if (valley.dampings[i] > valley.dampings[i - 1]) {
      EXPECT_GE(valley.dampings[i], 1e-2);
    }
}

TEST(LeastSquares, SaysWhenStepsDoNotSuffice) {
  Valley valley;
  const LeastSquaresSummary found = minimise(&valley, {.max_steps = 3});
  EXPECT_EQ(found.end, LeastSquaresEnd::too_many_steps);
  EXPECT_EQ(found.steps, 3);
  EXPECT_EQ(found.cost, valley.costs.back()) << "the best state is kept";
}

TEST(LeastSquares, NeverEntersWhereTheCostIsNotFinite) {
  for (const double cost : {k_nan, k_infinity}) {
    Valley valley;
    valley.is_forbidden = [](const Vector2d& p) { return p.x() > 0.5; };
    valley.forbidden_cost = cost;
    const LeastSquaresSummary found = minimise(&valley, {.max_steps = 200});
    EXPECT_LE(valley.state.x(), 0.5);
    EXPECT_TRUE(std::isfinite(found.cost));
    EXPECT_LT(found.cost, valley.costs.front());
    EXPECT_NE(found.end, LeastSquaresEnd::settled);
  }
}

TEST(LeastSquares, SaysThatNoStepLowersTheCost) {
  Valley valley;
  valley.is_forbidden = [](const Vector2d&) { return true; };
  const LeastSquaresSummary found = minimise(&valley, {.most_damping = 1e3});
  EXPECT_EQ(found.end, LeastSquaresEnd::no_gain);
  EXPECT_EQ(found.steps, 7);  // dampings of 1e-4 to 1e2
  EXPECT_EQ(valley.state, Vector2d(-1.2, 1));
}

TEST(LeastSquares, RefusesAStartWithoutAFiniteCost) {
  for (const double cost : {k_nan, k_infinity}) {
    Valley valley;
    valley.cost_here = cost;
    const LeastSquaresSummary found = minimise(&valley, {});
    EXPECT_EQ(found.end, LeastSquaresEnd::no_start);
    EXPECT_EQ(found.steps, 0);
    EXPECT_TRUE(valley.dampings.empty());
  }
}

TEST(LeastSquares, AStepThatChangesNothingCountsAsAsked) {
  for (const bool accepts : {true, false}) {
    Valley valley;
    valley.state = {1, 1};
    valley.cost_here = 0;
    const LeastSquaresSummary found = minimise(&valley, {.accepts_equal_cost = accepts});
    EXPECT_EQ(found.end, accepts ? LeastSquaresEnd::settled : LeastSquaresEnd::no_gain);
  }
}

// Equations that have a solution only when they are damped enough.
struct Stiff : Valley {
  double needs = 1e-2;
  bool solve(double damping) { return Valley::solve(damping) && damping >= needs; }
};

TEST(LeastSquares, DampsMoreWhereThereIsNoStepOrEndsAsAsked) {
  Stiff ends;
  EXPECT_EQ(minimise(&ends, {}).end, LeastSquaresEnd::no_step);
  EXPECT_EQ(ends.dampings.size(), 1U);

  Stiff goes_on;
  const LeastSquaresSummary found = minimise(&goes_on, {.max_steps = 2000, .damps_more_without_step = true});
  EXPECT_EQ(found.end, LeastSquaresEnd::settled);
  EXPECT_LT((goes_on.state - Vector2d(1, 1)).norm(), 1e-6);

  Stiff never;
  never.needs = k_infinity;
  EXPECT_EQ(minimise(&never, {.damps_more_without_step = true}).end, LeastSquaresEnd::no_step);
}

// A line y = a + b x through points, some of which are outliers.
template <class Loss>
struct Line {
  Loss loss;
  std::vector<Vector2d> points;
  double sigma = 1;
  Vector2d state{2.2, -3}, trial{}, step{}, gradient{};
  Matrix2d matrix{};

  double cost_at(const Vector2d& line) const {
    double sum = 0;
    for (const Vector2d& p : points) sum += loss.cost(std::pow(off(line, p), 2));
    return sum;
  }
  double off(const Vector2d& line, const Vector2d& p) const {
    return (line[0] + line[1] * p.x() - p.y()) / sigma;
  }
  double cost() const { return cost_at(state); }
  bool linearise() {
    matrix.setZero();
    gradient.setZero();
    for (const Vector2d& p : points) {
      const double r = off(state, p), weight = loss.weight(r * r);
      const Vector2d row = Vector2d(1, p.x()) / sigma;
      matrix += weight * row * row.transpose();
      gradient += weight * r * row;
    }
    return true;
  }
  bool solve(double damping) {
    step = -damped(matrix, damping).ldlt().solve(gradient);
    return true;
  }
  double evaluate_trial() { return cost_at(trial = state + step); }
  void accept_trial() { state = trial; }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && tried.gain() < 1e-12 * tried.cost_before;
  }
};

std::vector<Vector2d> points_with_outliers() {
  auto rng = test::test_rng();
  std::normal_distribution<double> noise(0, 0.01);
  std::vector<Vector2d> points;
  for (int i = 0; i < 100; ++i) {
    const double x = i / 100.0;
    points.emplace_back(x, 2 - 3 * x + noise(rng) + (i % 10 == 0 ? 5 : 0));
  }
  return points;
}

template <class Loss>
double error_of_line(const Loss& loss) {
  Line<Loss> line{.loss = loss, .points = points_with_outliers(), .sigma = 0.01};
  EXPECT_EQ(minimise(&line, {.max_steps = 500}).end, LeastSquaresEnd::settled);
  return (line.state - Vector2d(2, -3)).norm();
}

TEST(LeastSquares, RobustLossesHoldALineAgainstOutliers) {
  const double plain = error_of_line(HuberLoss{0});
  EXPECT_GT(plain, 0.3) << "plain squares follow the outliers (a tenth of the points, off by 5)";
  EXPECT_LT(error_of_line(HuberLoss{1.5}), 0.02);
  EXPECT_LT(error_of_line(CauchyLoss(2)), 0.01);
}

TEST(LeastSquares, AWeightIsTheSlopeOfItsLoss) {
  const HuberLoss huber{2}, plain{0};
  const CauchyLoss cauchy(3);
  for (const double square : {0.01, 1.0, 3.9, 4.1, 9.0, 1e4}) {
    const double h = 1e-5 * square;
    const auto slope = [&](const auto& loss) {
      return (loss.cost(square + h) - loss.cost(square - h)) / (2 * h);
    };
    EXPECT_NEAR(huber.weight(square), slope(huber), 1e-6) << square;
    EXPECT_NEAR(cauchy.weight(square), slope(cauchy), 1e-6) << square;
    EXPECT_EQ(plain.weight(square), 1);
    EXPECT_EQ(plain.cost(square), square);
  }
  EXPECT_EQ(huber.cost(4), 4);
  EXPECT_NEAR(cauchy.weight(9), 0.5, 1e-15);
}

TEST(LeastSquares, DampsTheDiagonalAlone) {
  Matrix2d matrix, expected;
  matrix << 2, 1, 1, 4;
  expected << 3, 1, 1, 6;
  EXPECT_EQ(damped(matrix, 0.5), expected);
}

}  // namespace
}  // namespace limn
