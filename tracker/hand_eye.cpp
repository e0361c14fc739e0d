#include "tracker/hand_eye.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "tracker/pose_fit.h"

namespace limn::tracker {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix6x12d = Eigen::Matrix<double, 6, 12>;
using Vector12d = Eigen::Matrix<double, 12, 1>;

constexpr std::size_t k_least_pairs = 3;
constexpr int k_most_steps = 50;
constexpr double k_robust_at = 2, k_outlier_at = 4;  // standard deviations, of one of six coordinates
// Rotations must differ about two axes by this much, or a direction stays undetermined.
constexpr double k_least_turn = 5 * std::numbers::pi / 180;

Matrix3d nearest_rotation(const Matrix3d& m) {
  const Eigen::JacobiSVD<Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) {
    Matrix3d u = svd.matrixU();
    u.col(2) *= -1;
    rotation = u * svd.matrixV().transpose();
  }
  return rotation;
}

// By how much the bodies are turned against each other, about the axis of most and of second most rotation:
// singular values of the scatter of rotation vectors.
Vector3d spread_of_turns(std::span<const PosePair> pairs) {
  const Eigen::Quaterniond first = pairs[0].world_from_body.rotation;
  Matrix3d sum = Matrix3d::Zero();
  Vector3d mean = Vector3d::Zero();
  for (const PosePair& pair : pairs)
    mean +=
        log_rotation(first.conjugate() * pair.world_from_body.rotation) / static_cast<double>(pairs.size());
  for (const PosePair& pair : pairs) {
    const Vector3d w = log_rotation(first.conjugate() * pair.world_from_body.rotation) - mean;
    sum += w * w.transpose() / static_cast<double>(pairs.size());
  }
  Vector3d spread = Eigen::SelfAdjointEigenSolver<Matrix3d>(sum).eigenvalues().cwiseMax(0).cwiseSqrt();
  return spread.reverse();
}

// R_a R_x R_b^T = R_y, as vectors: (R_b (x) R_a) vec(R_x) = vec(R_y). Summed over the pairs, R_x and R_y are
// the singular vectors of the largest singular value.
std::pair<Matrix3d, Matrix3d> closed_rotations(std::span<const PosePair> pairs) {
  Matrix9d sum = Matrix9d::Zero();
  for (const PosePair& pair : pairs) {
    const Matrix3d a = pair.world_from_body.rotation_matrix(), b = pair.feed_from_sensor.rotation_matrix();
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) sum.block<3, 3>(3 * row, 3 * column) += b(row, column) * a;
  }
  const Eigen::JacobiSVD<Matrix9d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix<double, 9, 1> x = svd.matrixV().col(0), y = svd.matrixU().col(0);
  const Eigen::Map<const Matrix3d> as_matrix(x.data());
  if (as_matrix.determinant() < 0) x *= -1, y *= -1;
  return {nearest_rotation(Eigen::Map<const Matrix3d>(x.data())),
          nearest_rotation(Eigen::Map<const Matrix3d>(y.data()))};
}

// R_a t_x + t_a = R_y t_b + t_y, linear in t_x and t_y.
HandEye closed_solution(std::span<const PosePair> pairs) {
  const auto [x, y] = closed_rotations(pairs);
  Matrix6d normal = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  for (const PosePair& pair : pairs) {
    Eigen::Matrix<double, 3, 6> row;
    row << pair.world_from_body.rotation_matrix(), -Matrix3d::Identity();
    normal += row.transpose() * row;
    right += row.transpose() * (y * pair.feed_from_sensor.translation - pair.world_from_body.translation);
  }
  const Vector6d both = normal.ldlt().solve(right);
  HandEye solution;
  solution.body_from_sensor = Pose(x, both.head<3>());
  solution.world_from_feed = Pose(y, both.tail<3>());
  return solution;
}

// One pair's residual, its derivatives by both poses' perturbations, and its covariance.
struct Row {
  Vector6d residual;
  Matrix6x12d jacobian;
  Matrix6d covariance;
};

Row row_of(const PosePair& pair, const HandEye& at) {
  const Pose& a = pair.world_from_body;
  const Pose &x = at.body_from_sensor, &y = at.world_from_feed;
  const Matrix3d ra = a.rotation_matrix(), ry = y.rotation_matrix();
  const Vector3d x_turned = a.rotation * x.translation,
                 b_turned = y.rotation * pair.feed_from_sensor.translation;
  Row row;
  row.residual = boxminus(a * x, y * pair.feed_from_sensor);
  row.jacobian.setZero();
  row.jacobian.block<3, 3>(0, 0) = -Matrix3d::Identity();
  row.jacobian.block<3, 3>(3, 0) = skew(b_turned);
  row.jacobian.block<3, 3>(3, 3) = -Matrix3d::Identity();
  row.jacobian.block<3, 3>(0, 6) = ra;
  row.jacobian.block<3, 3>(3, 9) = ra;
  Matrix6d by_body = Matrix6d::Identity(), by_sensor = Matrix6d::Zero();
  by_body.block<3, 3>(3, 0) = -skew(x_turned);
  by_sensor.block<3, 3>(0, 0) = by_sensor.block<3, 3>(3, 3) = ry;
  row.covariance = by_body * pair.body_covariance * by_body.transpose() +
                   by_sensor * pair.sensor_covariance * by_sensor.transpose();
  return row;
}

struct Normal {
  Matrix12d matrix = Matrix12d::Zero();
  Vector12d right = Vector12d::Zero();
  double cost = 0, squared = 0;
  int outliers = 0;
};

// With Cauchy's loss over each pair.
Normal normal_at(std::span<const PosePair> pairs, const HandEye& at) {
  Normal normal;
  for (const PosePair& pair : pairs) {
    const Row row = row_of(pair, at);
    const Matrix6d weight = row.covariance.llt().solve(Matrix6d::Identity());
    const double squared = row.residual.dot(weight * row.residual) / 6;
    const double limit = k_robust_at * k_robust_at, factor = 1 / (1 + squared / limit);
    normal.cost += 3 * limit * std::log1p(squared / limit);
    normal.matrix += factor * row.jacobian.transpose() * weight * row.jacobian;
    normal.right -= factor * row.jacobian.transpose() * weight * row.residual;
    normal.outliers += squared > k_outlier_at * k_outlier_at;
    normal.squared += factor * squared;
  }
  return normal;
}

HandEye moved(const HandEye& from, const Vector12d& step) {
  HandEye to = from;
  to.world_from_feed = boxplus(from.world_from_feed, step.head<6>());
  to.body_from_sensor = boxplus(from.body_from_sensor, step.tail<6>());
  return to;
}

HandEye refined(std::span<const PosePair> pairs, HandEye at) {
  Normal here = normal_at(pairs, at);
  double damping = 1e-6;
  for (int step = 0; step < k_most_steps && damping < 1e6; ++step) {
    Matrix12d damped = here.matrix;
    damped.diagonal() *= 1 + damping;
    const Vector12d change = damped.ldlt().solve(here.right);
    const HandEye next = moved(at, change);
    const Normal there = normal_at(pairs, next);
    if (!(there.cost <= here.cost)) {
      damping *= 10;
      continue;
    }
    const double gain = here.cost - there.cost;
    at = next;
    here = there;
    damping = std::max(1e-12, damping / 10);
    if (gain < 1e-9 * (1 + here.cost)) break;
  }
  at.normalised_rms = std::sqrt(here.squared / static_cast<double>(pairs.size()));
  at.outliers = here.outliers;
  const double widened = std::max(1.0, at.normalised_rms);
  at.covariance = widened * widened * here.matrix.ldlt().solve(Matrix12d::Identity());
  return at;
}

// The speed at a moment; none outside of the list.
std::optional<double> speed_at(std::span<const TurnSpeed> speeds, double at_s) {
  const auto next = std::ranges::lower_bound(speeds, at_s, {}, &TurnSpeed::at_s);
  if (next == speeds.begin() || next == speeds.end()) return std::nullopt;
  const TurnSpeed &before = *(next - 1), &after = *next;
  const double share = (at_s - before.at_s) / (after.at_s - before.at_s);
  return before.rad_per_s + share * (after.rad_per_s - before.rad_per_s);
}

struct Misfit {
  double mean_square = std::numeric_limits<double>::infinity();
  int count = 0;
};

Misfit misfit(std::span<const TurnSpeed> early, std::span<const TurnSpeed> late, double delay_s) {
  double sum = 0;
  int count = 0;
  for (const TurnSpeed& speed : late) {
    const auto other = speed_at(early, speed.at_s - delay_s);
    if (!other) continue;
    sum += std::pow(speed.rad_per_s - *other, 2);
    ++count;
  }
  return count > 0 ? Misfit{sum / count, count} : Misfit();
}

}  // namespace

Result<HandEye> solve_hand_eye(std::span<const PosePair> pairs) {
  if (pairs.size() < k_least_pairs)
    return error("registration: expected {} pairs of poses or more, found {}. Move the device for longer.",
                 k_least_pairs, pairs.size());
  for (const PosePair& pair : pairs) {
    if (!pair.world_from_body.is_finite() || !pair.feed_from_sensor.is_finite())
      return error("registration: a pose is not finite. Leave it out.");
  }
  const Vector3d spread = spread_of_turns(pairs);
  if (spread[1] < k_least_turn)
    return error(
        "registration: expected rotations about two axes, found {:.1f} degrees about one and {:.1f} about "
        "another (standard deviations). Turn the device to and fro, and nod it.",
        spread[0] * 180 / std::numbers::pi, spread[1] * 180 / std::numbers::pi);
  HandEye solution = refined(pairs, closed_solution(pairs));
  if (!solution.covariance.allFinite() || !(solution.covariance.diagonal().minCoeff() > 0))
    return error("registration: the pairs do not determine it. Move and turn the device more.");
  return solution;
}

std::vector<TurnSpeed> turn_speeds(std::span<const TimedRotation> rotations) {
  std::vector<TurnSpeed> speeds;
  for (std::size_t i = 1; i < rotations.size(); ++i) {
    const double seconds = rotations[i].at_s - rotations[i - 1].at_s;
    if (!(seconds > 0)) continue;
    speeds.push_back({rotations[i - 1].at_s + seconds / 2,
                      angle_between(rotations[i - 1].rotation, rotations[i].rotation) / seconds});
  }
  return speeds;
}

Result<Delay> estimate_delay(std::span<const TurnSpeed> early,
                             std::span<const TurnSpeed> late,
                             double most_s) {
  constexpr double k_least_s = 1, k_step_s = 0.002;
  const double common_s = early.empty() || late.empty() ? 0
                                                        : std::min(early.back().at_s, late.back().at_s) -
                                                              std::max(early.front().at_s, late.front().at_s);
  if (!(common_s >= k_least_s))
    return error("delay: expected {} s in which both systems state poses, found {:.2f} s.", k_least_s,
                 std::max(0.0, common_s));
  const int steps = static_cast<int>(std::ceil(most_s / k_step_s));
  std::vector<double> costs;
  int best = 0, count = 0;
  for (int i = 0; i <= 2 * steps; ++i) {
    const Misfit at = misfit(early, late, (i - steps) * k_step_s);
    costs.push_back(at.mean_square);
    if (at.mean_square < costs[static_cast<std::size_t>(best)] || i == 0) best = i, count = at.count;
  }
  if (best == 0 || best == 2 * steps)
    return error("delay: expected at most {} s, found no minimum within. Turn the device to and fro.",
                 most_s);
  const auto at = static_cast<std::size_t>(best);
  const double curvature = costs[at - 1] - 2 * costs[at] + costs[at + 1];  // by steps
  const double mean = [&] {
    double sum = 0;
    for (const TurnSpeed& speed : late) sum += speed.rad_per_s / static_cast<double>(late.size());
    return sum;
  }();
  constexpr double k_least_speed = 0.05;  // rad/s
  if (!(curvature > 0) || mean < k_least_speed)
    return error("delay: no motion tells it. Turn the device to and fro.");
  const double offset = 0.5 * (costs[at - 1] - costs[at + 1]) / curvature;
  // The cost is the mean square of `count` residuals, and half its second derivative their mean squared
  // slope.
  const double slope2 = curvature / 2 / (k_step_s * k_step_s);
  return Delay{(best - steps + std::clamp(offset, -1.0, 1.0)) * k_step_s,
               std::sqrt(costs[at] / (slope2 * std::max(1, count)))};
}

}  // namespace limn::tracker
