#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

namespace limn {

/// How far a search goes and how its steps are damped. The defaults suit a start that lies near its minimum.
struct LeastSquaresOptions {
  int max_steps = 50;           ///< steps tried, accepted or not
  double first_damping = 1e-4;  ///< of the first step; less saves steps near a minimum, more costs some
  double least_damping = 1e-12;
  double most_damping = 1e8;  ///< the search ends where it would be reached: no shorter step lowers the cost
  /// A vain step raises the damping tenfold from at least this. More than 0 saves steps where the damping has
  /// fallen so far that it does not change a step.
  double raised_from = 0;
  bool accepts_equal_cost = true;        ///< whether a step that leaves the cost as it is counts as one down
  bool damps_more_without_step = false;  ///< instead of ending where the damped equations have no solution
};

/// A step that was tried.
struct LeastSquaresTrial {
  int step = 0;  ///< its number, from 0
  double cost_before = 0, cost_after = 0;
  bool is_accepted = false;

  double gain() const { return cost_before - cost_after; }
};

enum class LeastSquaresEnd {
  no_start,  ///< the cost of the start is not finite
  settled,   ///< the problem's own rule
  no_step,   ///< the (damped) equations have no solution
  no_gain,   ///< however much steps are damped, none lowers the cost
  too_many_steps
};

struct LeastSquaresSummary {
  LeastSquaresEnd end = LeastSquaresEnd::no_start;
  int steps = 0;                                           ///< tried, accepted or not
  double cost = std::numeric_limits<double>::quiet_NaN();  ///< at the problem's last state
};

/// What `minimise` works on: a sum of squares (or of robust losses of them) with a state, the normal
/// equations at that state, and a trial state beside it. The problem keeps all of them, in what form it
/// likes.
///   double cost()              of the state; asked for once, at the start.
///   bool linearise()           optional: makes the equations at the state, once for each state that a step
///                              starts from. False ends the search (no_step). Problems whose trial makes the
///                              equations with the cost do without.
///   bool solve(damping)        finds the step, for the diagonal times (1 + damping); false when there is
///   none.
///                              Sparse problems eliminate what they like here.
///   double evaluate_trial()    moves the trial there; its cost. Not finite: the state cannot be left that
///   way. void accept_trial()        the trial is the state from now on. bool is_settled(trial)     after
///   each trial, accepted or not: whether it was the last. Sound rules are that
///                              the step promised next to nothing, or that it was accepted and gained next to
///                              nothing (Madsen, Nielsen, Tingleff 2004, section 3.2).
template <class Problem>
concept LeastSquaresProblem = requires(Problem problem, double damping, const LeastSquaresTrial& trial) {
  { problem.cost() } -> std::convertible_to<double>;
  { problem.solve(damping) } -> std::convertible_to<bool>;
  { problem.evaluate_trial() } -> std::convertible_to<double>;
  problem.accept_trial();
  { problem.is_settled(trial) } -> std::convertible_to<bool>;
};

/// Takes the problem's state downhill to the minimum near it by Levenberg's and Marquardt's method (Levenberg
/// 1944; Marquardt 1963, "An algorithm for least-squares estimation of nonlinear parameters"): an accepted
/// step divides the damping by ten, a vain one multiplies it by ten. The cost never rises, and a trial whose
/// cost is NaN or infinite is never accepted. Allocates nothing itself.
template <LeastSquaresProblem Problem>
LeastSquaresSummary minimise(Problem* problem, const LeastSquaresOptions& options) {
  LeastSquaresSummary summary{.cost = problem->cost()};
  if (!std::isfinite(summary.cost)) return summary;
  double damping = options.first_damping;
  bool is_new = true;  // the state, to its equations
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
    // Written so that NaN is none.
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

/// The matrix of normal equations with its diagonal times 1 + damping: steps do not depend on the unknowns'
/// units (Marquardt 1963).
template <class Derived>
typename Derived::PlainObject damped(const Eigen::MatrixBase<Derived>& matrix, double damping) {
  typename Derived::PlainObject out = matrix;
  out.diagonal() *= 1 + damping;
  return out;
}

// Robust losses: what a residual costs as a function of its square, in squared standard deviations, and the
// weight that its square has in the normal equations, which is the loss's derivative (iteratively reweighted
// least squares; Holland and Welsch 1977).

/// Huber's (1964): squares up to `limit` standard deviations, linear beyond. A limit of 0 stands for plain
/// squares everywhere.
struct HuberLoss {
  double limit = 0;

  bool is_beyond(double square) const { return limit > 0 && square > limit * limit; }
  double cost(double square) const {
    return is_beyond(square) ? 2 * limit * std::sqrt(square) - limit * limit : square;
  }
  double weight(double square) const { return is_beyond(square) ? limit / std::sqrt(square) : 1; }
};

/// Cauchy's: grows with the logarithm, so that what is far off hardly counts. A residual of `limit` standard
/// deviations has half its weight.
struct CauchyLoss {
  explicit CauchyLoss(double limit) : square_limit(limit * limit) {}

  double cost(double square) const { return square_limit * std::log1p(square / square_limit); }
  double weight(double square) const { return 1 / (1 + square / square_limit); }

  double square_limit;
};

}  // namespace limn
