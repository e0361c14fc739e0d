#include "calib/propagate.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calib/predict.h"

namespace limn::calib {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_moved_m = 0.15;
constexpr double k_turned = 40 * std::numbers::pi / 180;
constexpr double k_two_sigma = 1.96;  // of an error along one line; of a round one 1.73
constexpr int k_grid = 5;             // points along each side of the thing

ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// The board's own place, and moved and turned about its middle.
std::vector<Pose> placements(const Pose& world_from_board, const BoardShape& shape) {
  const Pose to_middle(Eigen::Quaterniond::Identity(), Vector3d(shape.width_m / 2, shape.height_m / 2, 0));
  std::vector<Pose> all = {world_from_board};
  for (const double sign : {-1.0, 1.0}) {
    for (int axis = 0; axis < 3; ++axis) {
      Pose moved = world_from_board;
      moved.translation += sign * k_moved_m * Vector3d::Unit(axis);
      all.push_back(moved);
    }
    for (int axis = 0; axis < 2; ++axis)
      all.push_back(world_from_board * to_middle *
                    Pose(exp_rotation(sign * k_turned * Vector3d::Unit(axis)), Vector3d::Zero()) *
                    to_middle.inverse());
  }
  return all;
}

std::vector<Vector2d> grid_points(const BoardShape& shape) {
  std::vector<Vector2d> points;
  for (int i = 0; i < k_grid * k_grid; ++i)
    points.emplace_back(shape.width_m * (i % k_grid + 0.5) / k_grid,
                        shape.height_m * (i / k_grid + 0.5) / k_grid);
  return points;
}

// How the thing's pose, as the camera measures it, follows the camera's values: 6 x value count. Empty when
// the camera does not see it.
MatrixXd pose_by_values(const Imager& camera, const Pose& world_from_thing, const BoardShape& shape) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  MatrixXd product = MatrixXd::Zero(6, camera.lens.model.value_count());
  for (const Vector2d& xy : grid_points(shape)) {
    Vector2d px;
    Derivatives d;
    if (!predict_corner(view(camera), world_from_thing, shape, Vector2d::Zero(), xy, &px, &d) ||
        !camera.contains(px))
      return {};
    normal += d.board_pose.transpose() * d.board_pose;
    product += d.board_pose.transpose() * d.camera_values;
  }
  return -normal.ldlt().solve(product);
}

// 95 % errors of the thing's points that the projector reaches, mm.
void take_placement(const Observations& observations,
                    const Solution& solution,
                    const Pose& world_from_thing,
                    size_t projector,
                    std::vector<double>* errors) {
  const BoardShape shape{observations.board.width_m(), observations.board.height_m()};
  const Imager& camera = solution.rig.cameras.front();
  const Imager& light = solution.rig.projectors[projector];
  const MatrixXd by_camera = pose_by_values(camera, world_from_thing, shape);
  if (by_camera.size() == 0) return;
  const int at = solution.projector_at(projector), values = light.lens.model.value_count();
  for (const Vector2d& xy : grid_points(shape)) {
    Vector2d px;
    Derivatives d;
    if (!predict_corner(view(light), world_from_thing, shape, Vector2d::Zero(), xy, &px, &d) ||
        !light.contains(px))
      continue;
    MatrixXd sensitivity = MatrixXd::Zero(2, solution.covariance.cols());
    sensitivity.leftCols(by_camera.cols()) = d.board_pose * by_camera;  // camera 0's values come first
    sensitivity.middleCols(at, values) = d.camera_values;               // the imager's: here the projector's
    sensitivity.middleCols(at + values, 6) = d.camera_pose;
    const Eigen::Matrix2d px_covariance = sensitivity * solution.covariance * sensitivity.transpose();
    // From projector pixels to metres on the thing's surface.
    Eigen::Matrix2d px_by_m;
    constexpr double k_step = 1e-4;
    bool near = true;
    for (int axis = 0; axis < 2; ++axis) {
      Vector2d moved;
      near = near && predict_corner(view(light), world_from_thing, shape, Vector2d::Zero(),
                                    xy + k_step * Vector2d::Unit(axis), &moved);
      px_by_m.col(axis) = (moved - px) / k_step;
    }
    if (!near || std::abs(px_by_m.determinant()) < 1e-6) continue;
    const Eigen::Matrix2d m_by_px = px_by_m.inverse();
    const double variance = (m_by_px * px_covariance * m_by_px.transpose()).trace();
    errors->push_back(1e3 * k_two_sigma * std::sqrt(std::max(0.0, variance)));
  }
}

}  // namespace

std::vector<double> propagated_error_mm(const Observations& observations, const Solution& solution) {
  const BoardShape shape{observations.board.width_m(), observations.board.height_m()};
  std::vector<double> p95;
  for (size_t i = 0; i < solution.rig.projectors.size(); ++i) {
    std::vector<double> errors;
    for (const auto& board : solution.world_from_board) {
      if (!board) continue;
      for (const Pose& placed : placements(*board, shape))
        take_placement(observations, solution, placed, i, &errors);
    }
    std::sort(errors.begin(), errors.end());
    p95.push_back(errors.empty()
                      ? std::numeric_limits<double>::infinity()
                      : errors[static_cast<size_t>(0.95 * static_cast<double>(errors.size() - 1))]);
  }
  return p95;
}

}  // namespace limn::calib
