#include "tracker/marker_map_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/least_squares.h"
#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

constexpr int k_max_steps = 50;
constexpr double k_small_step = 1e-9;  // radians and metres

// One corner of a marker in an image.
struct Observation {
  std::size_t image, marker;
  Eigen::Vector3d p_marker;
  PointObservation corner_observation;  // its p_body is computed from the state
};

// The adjusted poses. The unknowns are ordered: images, then all markers except the fixed one, six each.
struct State {
  std::vector<Pose> world_from_body;   // one for each image
  std::vector<Pose> body_from_marker;  // one for each marker
};

struct Problem {
  std::vector<Observation> observations;
  std::size_t fixed = 0;  // index of the fixed marker

  Eigen::Index column(const State& state, std::size_t marker) const {
    return static_cast<Eigen::Index>(6 * (state.world_from_body.size() + marker - (marker > fixed ? 1 : 0)));
  }
};

Eigen::Index unknowns(const State& state) {
  return static_cast<Eigen::Index>(6 * (state.world_from_body.size() + state.body_from_marker.size() - 1));
}

State moved(const State& state, const Problem& problem, const Eigen::VectorXd& delta) {
  State out = state;
  for (std::size_t i = 0; i < out.world_from_body.size(); ++i)
    out.world_from_body[i] =
        boxplus(out.world_from_body[i], delta.segment<6>(static_cast<Eigen::Index>(6 * i)));
  for (std::size_t m = 0; m < out.body_from_marker.size(); ++m)
    if (m != problem.fixed)
      out.body_from_marker[m] = boxplus(out.body_from_marker[m], delta.segment<6>(problem.column(state, m)));
  return out;
}

PointObservation observation_at(const Observation& observation, const State& state) {
  PointObservation corner_observation = observation.corner_observation;
  corner_observation.p_body = state.body_from_marker[observation.marker] * observation.p_marker;
  return corner_observation;
}

double cost_of(const Problem& problem, const State& state) {
  double sum = 0;
  for (const Observation& observation : problem.observations) {
    const PointObservation corner_observation = observation_at(observation, state);
    sum += cost(std::span(&corner_observation, 1), state.world_from_body[observation.image], k_huber);
  }
  return sum;
}

struct Normal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd gradient;
};

// False when a corner has no pixel.
bool add(const Problem& problem, const State& state, const Observation& observation, Normal* normal) {
  const Pose& world_from_body = state.world_from_body[observation.image];
  const PointObservation corner_observation = observation_at(observation, state);
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 12> j;
  Eigen::Matrix<double, 2, 6> by_body;
  if (!residual(corner_observation, world_from_body, &r, &by_body)) return false;
  const Eigen::Matrix<double, 2, 3> by_point = by_body.rightCols<3>() * world_from_body.rotation_matrix();
  const Eigen::Vector3d turned = state.body_from_marker[observation.marker].rotation * observation.p_marker;
  j << by_body, -by_point * skew(turned), by_point;
  const double square = r.dot(corner_observation.information * r);
  const double weight = HuberLoss{k_huber}.weight(square);
  const Eigen::Matrix<double, 12, 12> h = weight * j.transpose() * corner_observation.information * j;
  const Eigen::Matrix<double, 12, 1> g = weight * j.transpose() * (corner_observation.information * r);
  const auto p = static_cast<Eigen::Index>(6 * observation.image);
  normal->matrix.block<6, 6>(p, p) += h.topLeftCorner<6, 6>();
  normal->gradient.segment<6>(p) += g.head<6>();
  if (observation.marker == problem.fixed) return true;
  const Eigen::Index m = problem.column(state, observation.marker);
  normal->matrix.block<6, 6>(m, m) += h.bottomRightCorner<6, 6>();
  normal->matrix.block<6, 6>(p, m) += h.topRightCorner<6, 6>();
  normal->matrix.block<6, 6>(m, p) += h.bottomLeftCorner<6, 6>();
  normal->gradient.segment<6>(m) += g.tail<6>();
  return true;
}

bool fill(const Problem& problem, const State& state, Normal* normal) {
  const Eigen::Index n = unknowns(state);
  normal->matrix = Eigen::MatrixXd::Zero(n, n);
  normal->gradient = Eigen::VectorXd::Zero(n);
  return std::all_of(
      problem.observations.begin(), problem.observations.end(),
      [&](const Observation& observation) { return add(problem, state, observation, normal); });
}

// The problem for minimise(): a trial needs only the cost, an accepted trial also the equations.
struct BodyProblem {
  const Problem& problem;
  State state, trial{};
  Normal normal{};
  Eigen::VectorXd delta{};

  double cost() const { return cost_of(problem, state); }
  bool linearise() { return fill(problem, state, &normal); }
  bool solve(double damping) {
    delta = damped(normal.matrix, damping).ldlt().solve(-normal.gradient);
    return delta.allFinite();
  }
  double evaluate_trial() {
    trial = moved(state, problem, delta);
    return cost_of(problem, trial);
  }
  void accept_trial() { state = std::move(trial); }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && delta.lpNorm<Eigen::Infinity>() < k_small_step;
  }
};

// Moves the state to the minimum near it; returns the cost there.
double adjust(const Problem& problem, State* state) {
  BodyProblem body{.problem = problem, .state = *state};
  const LeastSquaresSummary found = minimise(&body, {.max_steps = k_max_steps});
  *state = std::move(body.state);
  return found.cost;
}

// The problem with all images that show two or more of the start's markers and whose pose the start
// determines.
Problem posed_problem(const Body& start, const MarkerName& fixed, std::span<const View> views, State* state) {
  Problem problem;
  for (std::size_t m = 0; m < start.markers.size(); ++m) {
    state->body_from_marker.push_back(start.markers[m].body_from_marker);
    if (start.markers[m].marker == fixed) problem.fixed = m;
  }
  for (const View& view : views) {
    const BodyCorrespondences seen = correspondences(start, std::span(&view, 1));
    const std::vector<PoseFit> fits = minima(seen);
    if (seen.size() < 2 || fits.empty()) continue;
    const std::size_t image = state->world_from_body.size();
    for (const MarkerCorrespondences& marker : seen) {
      const Detection& detection = *marker.detections.front();
      const auto corners = square_corners(marker.marker->size_m);
      for (std::size_t i = 0; i < 4; ++i)
        problem.observations.push_back(
            {image, static_cast<std::size_t>(marker.marker - start.markers.data()), corners[i],
             PointObservation{&view.camera->lens, view.camera->imager_from_world, Eigen::Vector3d::Zero(),
                              detection.corners_px[i], detection.corner_covariance[i].inverse()}});
    }
    state->world_from_body.push_back(fits.front().world_from_body);
  }
  return problem;
}

double rms_px(const Problem& problem, const State& state) {
  double squares = 0;
  for (const Observation& observation : problem.observations) {
    Eigen::Vector2d r;
    if (!residual(observation_at(observation, state), state.world_from_body[observation.image], &r))
      return std::numeric_limits<double>::infinity();
    squares += r.squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(problem.observations.size()));
}

}  // namespace

Result<Adjustment> adjusted_marker_map(const Body& start,
                                       const MarkerName& fixed,
                                       std::span<const View> views) {
  State state;
  const Problem problem = posed_problem(start, fixed, views, &state);
  if (state.world_from_body.empty())
    return error("expected images that show two or more of the body's {} markers, found none among {}.",
                 start.markers.size(), views.size());
  const double chi_square = adjust(problem, &state);
  Normal normal;
  const bool projects = fill(problem, state, &normal);
  const Eigen::LDLT<Eigen::MatrixXd> inverse(normal.matrix);
  if (!projects || !std::isfinite(chi_square) || !inverse.isPositive() || inverse.info() != Eigen::Success)
    return error(
        "expected {} images to determine the places of all markers, found markers that they do not "
        "determine. Take more photographs, from nearer and from other sides.",
        state.world_from_body.size());
  const Eigen::MatrixXd covariance =
      inverse.solve(Eigen::MatrixXd::Identity(normal.matrix.rows(), normal.matrix.cols()));
  const double freedom =
      2 * static_cast<double>(problem.observations.size()) - static_cast<double>(unknowns(state));
  const double widened = std::max(1.0, chi_square / std::max(1.0, freedom));

  Adjustment out;
  out.body = start;
  out.images = static_cast<int>(state.world_from_body.size());
  out.rms_px = rms_px(problem, state);
  out.seen.assign(start.markers.size(), 0);
  for (const Observation& observation : problem.observations) ++out.seen[observation.marker];
  for (std::size_t m = 0; m < start.markers.size(); ++m) {
    out.body.markers[m].body_from_marker = state.body_from_marker[m];
    out.seen[m] /= 4;
    const Eigen::Index at = m == problem.fixed ? 0 : problem.column(state, m);
    out.covariance.push_back(m == problem.fixed ? Matrix6d(Matrix6d::Zero())
                                                : Matrix6d(widened * covariance.block<6, 6>(at, at)));
  }
  return out;
}

}  // namespace limn::tracker
