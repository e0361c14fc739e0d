#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

namespace limn {

/// When a search ends and how its steps are damped. The defaults suit a start near the minimum.
struct LeastSquaresOptions {
  int max_steps = 50;           ///< Steps tried, accepted or not.
  double first_damping = 1e-4;  ///< Damping of the first step; a low value saves steps near a minimum.
  double least_damping = 1e-12;
  double most_damping = 1e8;  ///< The search ends at this damping: no shorter step lowers the cost.
  /// A rejected step sets the damping to ten times its value, or ten times this if the damping is lower. A
  /// value above 0 saves steps where the damping has become too small to change a step.
  double raised_from = 0;
  bool accepts_equal_cost = true;  ///< Whether a step that does not change the cost is accepted.
  /// If the damped equations have no solution: true raises the damping, false ends the search.
  bool damps_more_without_step = false;
};

/// A step that was tried.
struct LeastSquaresTrial {
  int step = 0;  ///< The step's number, from 0.
  double cost_before = 0, cost_after = 0;
  bool is_accepted = false;

  double gain() const { return cost_before - cost_after; }
};

enum class LeastSquaresEnd {
  no_start,  ///< The cost of the start is not finite.
  settled,   ///< The problem's is_settled() returned true.
  no_step,   ///< The (damped) equations have no solution.
  no_gain,   ///< No step lowers the cost, even with the highest damping.
  too_many_steps
};

struct LeastSquaresSummary {
  LeastSquaresEnd end = LeastSquaresEnd::no_start;
  int steps = 0;                                           ///< Steps tried, accepted or not.
  double cost = std::numeric_limits<double>::quiet_NaN();  ///< Cost of the problem's final state.
};

/// What `minimise` works on: a sum of squares (or of robust losses of squares). The problem stores a state,
/// the normal equations at that state and a trial state, in any form. Its functions:
/// - `double cost()`: Returns the cost of the state. It is called once, at the start.
/// - `bool linearise()`: Optional. Makes the equations at the state, once for each state that a step starts
///   from. False ends the search (no_step). A problem whose evaluate_trial() already makes the equations does
///   not need it.
/// - `bool solve(damping)`: Finds the step for the diagonal times (1 + damping); false when there is no
///   solution. Sparse problems can eliminate unknowns here.
/// - `double evaluate_trial()`: Makes the trial state by that step and returns its cost. A cost that is not
///   finite means that the step is impossible.
/// - `void accept_trial()`: Makes the trial state the state.
/// - `bool is_settled(trial)`: Says after each trial, accepted or not, whether it was the last. Good rules:
///   the step predicted almost no gain, or it was accepted and gained almost nothing (Madsen, Nielsen,
///   Tingleff 2004, section 3.2).
template <class Problem>
concept LeastSquaresProblem = requires(Problem problem, double damping, const LeastSquaresTrial& trial) {
  { problem.cost() } -> std::convertible_to<double>;
  { problem.solve(damping) } -> std::convertible_to<bool>;
  { problem.evaluate_trial() } -> std::convertible_to<double>;
  problem.accept_trial();
  { problem.is_settled(trial) } -> std::convertible_to<bool>;
};

/// Moves the problem's state to a local minimum by the Levenberg-Marquardt method (Levenberg 1944; Marquardt
/// 1963, "An algorithm for least-squares estimation of nonlinear parameters"): an accepted step divides the
/// damping by ten, a rejected one multiplies it by ten. The cost never rises, and a trial whose cost is NaN
/// or infinite is never accepted. The function itself allocates no memory.
template <LeastSquaresProblem Problem>
LeastSquaresSummary minimise(Problem* problem, const LeastSquaresOptions& options) {
  LeastSquaresSummary summary{.cost = problem->cost()};
  if (!std::isfinite(summary.cost)) return summary;
  double damping = options.first_damping;
  bool is_new = true;  // whether the state has no equations yet
  while (summary.steps < options.max_steps) {
    summary.end = LeastSquaresEnd::no_step;
    if constexpr (requires { problem->linearise(); }) {
      if (is_new && !problem->linearise()) return summary;
      is_new = false;
    }
    LeastSquaresTrial trial{.step = summary.steps++, .cost_before = summary.cost};
    if (!problem->solve(damping)) {
      if (!options.damps_more_without_step) return summary;
      damping = std::max(10 * damping, options.first_damping);
      if (damping >= options.most_damping) return summary;
      continue;
    }
    trial.cost_after = problem->evaluate_trial();
    // Written so that a cost of NaN is not accepted.
    trial.is_accepted = options.accepts_equal_cost ? trial.cost_after <= trial.cost_before
                                                   : trial.cost_after < trial.cost_before;
    if (trial.is_accepted) {
      problem->accept_trial();
      summary.cost = trial.cost_after;
      damping = std::max(damping / 10, options.least_damping);
      is_new = true;
    } else {
      damping = std::max(damping, options.raised_from) * 10;
    }
    summary.end = LeastSquaresEnd::settled;
    if (problem->is_settled(trial)) return summary;
    summary.end = LeastSquaresEnd::no_gain;
    if (damping >= options.most_damping) return summary;
  }
  summary.end = LeastSquaresEnd::too_many_steps;
  return summary;
}

/// The matrix of normal equations with its diagonal times (1 + damping). This damping makes steps independent
/// of the unknowns' units (Marquardt 1963).
template <class Derived>
typename Derived::PlainObject damped(const Eigen::MatrixBase<Derived>& matrix, double damping) {
  typename Derived::PlainObject out = matrix;
  out.diagonal() *= 1 + damping;
  return out;
}

// Robust losses. cost() is a residual's cost as a function of its square, in squared standard deviations.
// weight() is the derivative of the cost: the weight of the square in the normal equations (iteratively
// reweighted least squares; Holland and Welsch 1977).

/// Huber's loss (1964): quadratic up to `limit` standard deviations, linear beyond. A limit of 0 means
/// quadratic everywhere.
struct HuberLoss {
  double limit = 0;

  bool is_beyond(double square) const { return limit > 0 && square > limit * limit; }
  double cost(double square) const {
    return is_beyond(square) ? 2 * limit * std::sqrt(square) - limit * limit : square;
  }
  double weight(double square) const { return is_beyond(square) ? limit / std::sqrt(square) : 1; }
};

/// Cauchy's loss: grows with the logarithm of the square, so that outliers hardly count. A residual of
/// `limit` standard deviations has half of its weight.
struct CauchyLoss {
  explicit CauchyLoss(double limit) : square_limit(limit * limit) {}

  double cost(double square) const { return square_limit * std::log1p(square / square_limit); }
  double weight(double square) const { return 1 / (1 + square / square_limit); }

  double square_limit;
};

}  // namespace limn
