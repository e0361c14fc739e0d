#include "tracker/balls/constellation_learning.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/least_squares.h"
#include "core/linear_algebra.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {
namespace {

constexpr int k_max_steps = 60;
constexpr double k_small_step = 1e-9;    // radians and metres
constexpr double k_ball_size = 0.004;    // relative deviation of one ball's angular size, besides the image's
constexpr double k_centre_px = 0.03;     // that of a centre
constexpr double k_coarse_gate = 4;      // in standard deviations of two coarse places
constexpr double k_coarse_m = 4e-3;      // besides
constexpr double k_coarse_size = 0.015;  // relative deviation of a distance from the camera
constexpr int k_rounds = 4;              // adjustment, identification, adjustment ...
constexpr std::size_t k_least_images = 3;
constexpr double k_least_seen_share =
    0.3;  // share of the images: balls that fewer show are no part of the body

struct Observation {
  std::size_t image, ball;  // ball: of the constellation
  PointObservation centre;  // its p_body is computed from the state
  double log_sine;          // logarithm of the sine of the half angle
  double log_deviation;
};

struct State {
  std::vector<Pose> world_from_body;  // one for each image; that of the fixed one stays
  std::vector<Eigen::Vector3d> p_balls;
};

struct Normal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd gradient;
};

Eigen::Vector3d coarse_place(const Ball& ball, const Imager& camera, double radius_m) {
  return camera.imager_from_world.inverse() * p_centre_of(ball, radius_m);
}

double coarse_deviation(const Ball& ball, double radius_m) {
  return distance_of(ball, radius_m) * std::hypot(ball.half_angle_stddev / ball.half_angle, k_coarse_size);
}

Observation observation_of(const Ball& ball, const Imager& camera, std::size_t image, std::size_t in_body) {
  const Eigen::Matrix2d covariance =
      ball.centre_covariance + k_centre_px * k_centre_px * Eigen::Matrix2d::Identity();
  return {image, in_body,
          PointObservation{&camera.lens, camera.imager_from_world, Eigen::Vector3d::Zero(), ball.centre_px,
                           covariance.inverse()},
          std::log(std::sin(ball.half_angle)),
          std::hypot(ball.half_angle_stddev / std::tan(ball.half_angle), k_ball_size)};
}

// The adjustment as a problem for minimise(). The unknowns are ordered: images except the fixed one, six
// each, then balls, three each.
struct Adjustment {
  std::vector<Observation> observations;
  double radius_m;
  std::size_t fixed;
  State state, trial{};
  Normal normal{};
  Eigen::VectorXd delta{};

  Eigen::Index column_of_image(std::size_t image) const {
    return static_cast<Eigen::Index>(6 * (image - (image > fixed ? 1 : 0)));
  }
  Eigen::Index column_of_ball(std::size_t ball) const {
    return static_cast<Eigen::Index>(6 * (state.world_from_body.size() - 1) + 3 * ball);
  }
  Eigen::Index unknowns() const { return column_of_ball(state.p_balls.size()); }

  // The residuals of one observation, normalised, and their derivatives by the pose's delta and the ball.
  struct Residuals {
    Eigen::Vector3d value;  // two of the centre, one of the size
    Eigen::Matrix<double, 3, 6> by_pose;
    Eigen::Matrix3d by_ball;
  };
  std::optional<Residuals> residuals_of(const Observation& observation, const State& at) const {
    PointObservation centre = observation.centre;
    centre.p_body = at.p_balls[observation.ball];
    const Pose& pose = at.world_from_body[observation.image];
    Eigen::Vector2d off;
    Eigen::Matrix<double, 2, 6> by_pose;
    if (!residual(centre, pose, &off, &by_pose)) return std::nullopt;
    const Eigen::Matrix2d scale = centre.information.llt().matrixU();
    const Eigen::Vector3d turned = pose.rotation * centre.p_body;
    const Eigen::Vector3d p = centre.camera_from_world * (turned + pose.translation);
    const Eigen::RowVector3d by_place =
        p.transpose() / p.squaredNorm() * centre.camera_from_world.rotation_matrix();
    Residuals out;
    out.value << scale * off,
        (observation.log_sine + std::log(p.norm() / radius_m)) / observation.log_deviation;
    out.by_pose << scale * by_pose, Eigen::Matrix<double, 1, 6>::Zero();
    out.by_pose.bottomLeftCorner<1, 3>() = -by_place * skew(turned) / observation.log_deviation;
    out.by_pose.bottomRightCorner<1, 3>() = by_place / observation.log_deviation;
    out.by_ball = out.by_pose.rightCols<3>() * pose.rotation_matrix();
    return out;
  }
  double cost_of(const State& at) const {
    double sum = 0;
    for (const Observation& observation : observations) {
      const auto residuals = residuals_of(observation, at);
      if (!residuals) return std::numeric_limits<double>::infinity();
      sum += HuberLoss{k_huber}.cost(residuals->value.squaredNorm());
    }
    return sum;
  }
  double cost() const { return cost_of(state); }
  bool linearise() {
    normal.matrix = Eigen::MatrixXd::Zero(unknowns(), unknowns());
    normal.gradient = Eigen::VectorXd::Zero(unknowns());
    for (const Observation& observation : observations) {
      const auto r = residuals_of(observation, state);
      if (!r) return false;
      const double w = HuberLoss{k_huber}.weight(r->value.squaredNorm());
      const Eigen::Index b = column_of_ball(observation.ball);
      normal.matrix.block<3, 3>(b, b) += w * r->by_ball.transpose() * r->by_ball;
      normal.gradient.segment<3>(b) += w * r->by_ball.transpose() * r->value;
      if (observation.image == fixed) continue;
      const Eigen::Index i = column_of_image(observation.image);
      normal.matrix.block<6, 6>(i, i) += w * r->by_pose.transpose() * r->by_pose;
      normal.gradient.segment<6>(i) += w * r->by_pose.transpose() * r->value;
      const Eigen::Matrix<double, 6, 3> mixed = w * r->by_pose.transpose() * r->by_ball;
      normal.matrix.block<6, 3>(i, b) += mixed;
      normal.matrix.block<3, 6>(b, i) += mixed.transpose();
    }
    return true;
  }
  bool solve(double damping) {
    delta = damped(normal.matrix, damping).ldlt().solve(-normal.gradient);
    return delta.allFinite();
  }
  double evaluate_trial() {
    trial = state;
    for (std::size_t i = 0; i < trial.world_from_body.size(); ++i)
      if (i != fixed)
        trial.world_from_body[i] = boxplus(trial.world_from_body[i], delta.segment<6>(column_of_image(i)));
    for (std::size_t b = 0; b < trial.p_balls.size(); ++b)
      trial.p_balls[b] += delta.segment<3>(column_of_ball(b));
    return cost_of(trial);
  }
  void accept_trial() { state = trial; }
  bool is_settled(const LeastSquaresTrial& tried) const {
    return tried.is_accepted && delta.lpNorm<Eigen::Infinity>() < k_small_step;
  }
};

// A first identification: which balls of an image are which of the reference image, by coarse places.
struct CoarseMatch {
  Pose reference_from_image;                      // in the world's axes
  std::vector<std::array<std::size_t, 2>> pairs;  // ball of the image, ball of the reference
  double cost = 0;
};

struct CoarseBalls {
  std::vector<Eigen::Vector3d> p;
  std::vector<double> deviations;
};

CoarseBalls coarse_balls(const BallView& view, double radius_m) {
  CoarseBalls coarse;
  for (const Ball& ball : view.balls) {
    coarse.p.push_back(coarse_place(ball, *view.camera, radius_m));
    coarse.deviations.push_back(coarse_deviation(ball, radius_m));
  }
  return coarse;
}

// The balls that a motion brings near each other. Costs are lower than that of a ball without a partner.
CoarseMatch matched(const CoarseBalls& image,
                    const CoarseBalls& reference,
                    const Pose& reference_from_image) {
  CoarseMatch match{reference_from_image, {}, 0};
  std::vector<char> is_used(reference.p.size(), 0);
  for (std::size_t i = 0; i < image.p.size(); ++i) {
    const Eigen::Vector3d p = reference_from_image * image.p[i];
    double least = k_coarse_gate * k_coarse_gate;
    std::optional<std::size_t> nearest;
    for (std::size_t k = 0; k < reference.p.size(); ++k) {
      const double deviation = std::hypot(image.deviations[i], reference.deviations[k], k_coarse_m);
      const double square = (p - reference.p[k]).squaredNorm() / (deviation * deviation);
      if (!is_used[k] && square < least) least = square, nearest = k;
    }
    match.cost += least;
    if (!nearest) continue;
    is_used[*nearest] = 1;
    match.pairs.push_back({i, *nearest});
  }
  return match;
}

// The motion that matches most balls, from all triples of both images; fewer than three pairs: none.
CoarseMatch best_match(const CoarseBalls& image, const CoarseBalls& reference) {
  CoarseMatch best;
  const auto suits = [&](std::size_t i, std::size_t k, std::size_t a, std::size_t b) {
    const double within = k_coarse_gate * std::hypot(image.deviations[i], image.deviations[k]) + k_coarse_m;
    return std::abs((image.p[i] - image.p[k]).norm() - (reference.p[a] - reference.p[b]).norm()) < within;
  };
  const std::size_t n = image.p.size(), m = reference.p.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j)
      for (std::size_t k = j + 1; k < n; ++k)
        for (std::size_t a = 0; a < m; ++a)
          for (std::size_t b = 0; b < m; ++b)
            for (std::size_t c = 0; c < m; ++c) {
              if (a == b || a == c || b == c || !suits(i, j, a, b) || !suits(i, k, a, c) ||
                  !suits(j, k, b, c))
                continue;
              const std::array<Eigen::Vector3d, 3> to = {reference.p[a], reference.p[b], reference.p[c]};
              const std::array<Eigen::Vector3d, 3> from = {image.p[i], image.p[j], image.p[k]};
              const CoarseMatch match = matched(image, reference, aligned(to, from));
              if (match.pairs.size() > best.pairs.size() ||
                  (match.pairs.size() == best.pairs.size() && match.cost < best.cost))
                best = match;
            }
  return best;
}

// The start: the reference image's coarse places and each image's best match to them.
Adjustment started(std::span<const BallView> views, std::size_t reference, double radius_m) {
  Adjustment adjustment{{}, radius_m, 0, {}};
  const CoarseBalls of_reference = coarse_balls(views[reference], radius_m);
  adjustment.state.p_balls = of_reference.p;
  const auto use = [&](std::size_t view, const CoarseMatch& match) {
    for (const auto& [ball, in_body] : match.pairs)
      adjustment.observations.push_back(observation_of(views[view].balls[ball], *views[view].camera,
                                                       adjustment.state.world_from_body.size(), in_body));
    adjustment.state.world_from_body.push_back(match.reference_from_image.inverse());
  };
  CoarseMatch own;
  for (std::size_t i = 0; i < of_reference.p.size(); ++i) own.pairs.push_back({i, i});
  use(reference, own);
  for (std::size_t view = 0; view < views.size(); ++view) {
    if (view == reference) continue;
    const CoarseMatch match = best_match(coarse_balls(views[view], radius_m), of_reference);
    if (match.pairs.size() >= 3) use(view, match);
  }
  return adjustment;
}

// The same balls, identified in each image by their learned places. Images in which they are not recognised
// are left out. The first image that is used is the fixed one.
Adjustment identified_again(std::span<const BallView> views, const Adjustment& before) {
  const Constellation learned{"", before.radius_m, before.state.p_balls};
  Adjustment after{{}, before.radius_m, 0, {{}, before.state.p_balls}};
  for (const BallView& view : views) {
    const auto fits = identified(std::span(&learned, 1), std::span(&view, 1));
    if (fits[0].empty()) continue;
    for (const BallMatch& match : fits[0][0].matches)
      after.observations.push_back(observation_of(
          view.balls[match.ball], *view.camera, after.state.world_from_body.size(), match.in_constellation));
    after.state.world_from_body.push_back(fits[0][0].fit.world_from_body);
  }
  return after;
}

// Removes balls that few images show; returns how many.
int drop_rare_balls(Adjustment* adjustment) {
  State& state = adjustment->state;
  std::vector<double> seen(state.p_balls.size(), 0);
  for (const Observation& observation : adjustment->observations) ++seen[observation.ball];
  const double least = std::max(2.0, k_least_seen_share * static_cast<double>(state.world_from_body.size()));
  std::vector<std::size_t> number(seen.size());
  std::vector<Eigen::Vector3d> kept;
  for (std::size_t b = 0; b < seen.size(); ++b) {
    number[b] = kept.size();
    if (seen[b] >= least) kept.push_back(state.p_balls[b]);
  }
  const int dropped = static_cast<int>(seen.size() - kept.size());
  std::erase_if(adjustment->observations, [&](const Observation& o) { return seen[o.ball] < least; });
  for (Observation& observation : adjustment->observations) observation.ball = number[observation.ball];
  state.p_balls = std::move(kept);
  return dropped;
}

// Body axes: columns are x, y, z; and the balls' mean.
struct Axes {
  Eigen::Matrix3d d;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
};

Axes principal_axes(const std::vector<Eigen::Vector3d>& p) {
  Axes axes;
  for (const Eigen::Vector3d& one : p) axes.mean += one / static_cast<double>(p.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& one : p) scatter += (one - axes.mean) * (one - axes.mean).transpose();
  const Eigen::Matrix3d vectors = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors();
  axes.d << vectors.col(2), vectors.col(1), vectors.col(2).cross(vectors.col(1));
  return axes;
}

// The covariance of all balls' places without that of the frame: motions of all balls together are removed.
Eigen::MatrixXd free_of_frame(const Eigen::MatrixXd& covariance, const std::vector<Eigen::Vector3d>& p) {
  const Eigen::Vector3d mean = principal_axes(p).mean;
  Eigen::MatrixXd motions(3 * static_cast<Eigen::Index>(p.size()), 6);
  for (std::size_t b = 0; b < p.size(); ++b)
    motions.middleRows<3>(3 * static_cast<Eigen::Index>(b)) << -skew(p[b] - mean),
        Eigen::Matrix3d::Identity();
  const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()) -
                               motions * (motions.transpose() * motions).ldlt().solve(motions.transpose());
  return rest * covariance * rest.transpose();
}

Result<LearnedConstellation> result_of(Adjustment* adjustment, double chi_square, const std::string& name) {
  const State& state = adjustment->state;
  const auto undetermined = [&] {
    return error(
        "expected {} images to determine the places of {} balls, found that they do not. Add photographs "
        "from "
        "nearer and from other sides.",
        state.world_from_body.size(), state.p_balls.size());
  };
  if (!std::isfinite(chi_square) || !adjustment->linearise()) return undetermined();
  const Eigen::LDLT<Eigen::MatrixXd> inverse(adjustment->normal.matrix);
  if (!inverse.isPositive() || inverse.info() != Eigen::Success) return undetermined();
  const Eigen::Index n = adjustment->unknowns(), first = adjustment->column_of_ball(0);
  const double freedom = 3 * static_cast<double>(adjustment->observations.size()) - static_cast<double>(n);
  const Eigen::MatrixXd all = inverse.solve(Eigen::MatrixXd::Identity(n, n));
  if (!all.allFinite()) return undetermined();
  const Eigen::MatrixXd covariance =
      std::max(1.0, chi_square / std::max(1.0, freedom)) *
      free_of_frame(all.bottomRightCorner(n - first, n - first), state.p_balls);
  LearnedConstellation learned;
  learned.constellation = {name, adjustment->radius_m, {}};
  const Axes axes = principal_axes(state.p_balls);
  for (std::size_t b = 0; b < state.p_balls.size(); ++b) {
    const Eigen::Index at = 3 * static_cast<Eigen::Index>(b);
    const Eigen::Matrix3d own = axes.d.transpose() * covariance.block<3, 3>(at, at) * axes.d;
    learned.constellation.p_balls.emplace_back(axes.d.transpose() * (state.p_balls[b] - axes.mean));
    learned.stddev_m.emplace_back(own.diagonal().cwiseMax(0).cwiseSqrt());
  }
  learned.images = static_cast<int>(state.world_from_body.size());
  learned.images_of_ball.assign(state.p_balls.size(), 0);
  double squares = 0;
  for (const Observation& observation : adjustment->observations) {
    ++learned.images_of_ball[observation.ball];
    PointObservation centre = observation.centre;
    centre.p_body = state.p_balls[observation.ball];
    Eigen::Vector2d off;
    if (!residual(centre, state.world_from_body[observation.image], &off)) return undetermined();
    squares += off.squaredNorm();
  }
  learned.rms_px = std::sqrt(squares / static_cast<double>(adjustment->observations.size()));
  return learned;
}

}  // namespace

Result<LearnedConstellation> learn_constellation(std::span<const BallView> views,
                                                 double radius_m,
                                                 const std::string& name) {
  const auto most =
      std::ranges::max_element(views, {}, [](const BallView& view) { return view.balls.size(); });
  if (most == views.end() || most->balls.size() < 3)
    return error(
        "expected photographs that show three or more balls, found at most {} in one of {}. Balls must be at "
        "least 8 "
        "px wide, brighter than what is around them, and not touch each other in the image.",
        most == views.end() ? 0 : most->balls.size(), views.size());
  if (most->balls.size() > k_most_balls)
    return error("expected photographs of at most {} balls, found {} in one. Remove other round things.",
                 k_most_balls, most->balls.size());
  Adjustment adjustment = started(views, static_cast<std::size_t>(most - views.begin()), radius_m);
  double chi_square = 0;
  int dropped = 0;
  for (int round = 0; round < k_rounds; ++round) {
    if (round > 0) adjustment = identified_again(views, adjustment);
    if (adjustment.state.world_from_body.size() < k_least_images)
      return error(
          "expected {} or more photographs in which the same balls lie alike, found {} of {}. Use balls of "
          "one size "
          "that are fixed to each other, and have one photograph show all.",
          k_least_images, adjustment.state.world_from_body.size(), views.size());
    dropped += drop_rare_balls(&adjustment);
    if (adjustment.state.p_balls.size() < 3)
      return error("expected three or more balls that several photographs show, found {}.",
                   adjustment.state.p_balls.size());
    chi_square = minimise(&adjustment, {.max_steps = k_max_steps}).cost;
  }
  LIMN_TRY(LearnedConstellation learned, result_of(&adjustment, chi_square, name));
  learned.dropped_balls = dropped;
  LIMN_TRY_STATUS(check_constellation(learned.constellation));
  return learned;
}

}  // namespace limn::tracker
