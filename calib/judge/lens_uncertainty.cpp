#include "calib/judge/lens_uncertainty.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <vector>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_grid = 7;              // places along each side
constexpr double k_share = 0.9;        // share of the places that the result holds for
constexpr double k_turn_rad = 1e-5;    // step of a numeric derivative
constexpr double k_value_step = 1e-5;  // likewise, as a share of the value or of 1

// Derivatives of the pixels of the grid's directions by the lens's values and by a rotation: two rows a
// place.
struct GridDerivatives {
  Eigen::MatrixXd by_values, by_turn;
};

bool derive(const Lens& lens, const std::vector<Vector3d>& directions, GridDerivatives* found) {
  const auto places = static_cast<Eigen::Index>(directions.size());
  const auto values = static_cast<Eigen::Index>(lens.values.size());
  *found = {Eigen::MatrixXd(2 * places, values), Eigen::MatrixXd(2 * places, 3)};
  for (Eigen::Index i = 0; i < places; ++i) {
    const Vector3d& d = directions[static_cast<size_t>(i)];
    const auto px = lens.project(d);
    if (!px) return false;
    for (Eigen::Index k = 0; k < values; ++k) {
      Lens moved = lens;
      double& value = moved.values[static_cast<size_t>(k)];
      const double step = k_value_step * std::max(1.0, std::abs(value));
      value += step;
      const auto at = moved.project(d);
      if (!at) return false;
      found->by_values.block<2, 1>(2 * i, k) = (*at - *px) / step;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = lens.project(d + k_turn_rad * Vector3d::Unit(axis).cross(d));
      if (!at) return false;
      found->by_turn.block<2, 1>(2 * i, axis) = (*at - *px) / k_turn_rad;
    }
  }
  return true;
}

// First index of a camera's values in the solution's covariance.
Eigen::Index column_of(const Solution& solution, size_t camera) {
  Eigen::Index at = 0;
  for (size_t i = 0; i < camera; ++i)
    at += static_cast<Eigen::Index>(solution.rig.cameras[i].lens.values.size()) + 6;
  return at;
}

}  // namespace

double lens_stddev_px(const Solution& solution, size_t camera) {
  constexpr double k_unknown = std::numeric_limits<double>::infinity();
  const Imager& imager = solution.rig.cameras[camera];
  std::vector<Vector3d> directions;
  for (int row = 0; row < k_grid; ++row) {
    for (int column = 0; column < k_grid; ++column) {
      const auto d = imager.lens.unproject(
          {(column + 0.5) / k_grid * imager.width - 0.5, (row + 0.5) / k_grid * imager.height - 0.5});
      if (!d) return k_unknown;
      directions.push_back(*d);
    }
  }
  GridDerivatives by;
  if (!derive(imager.lens, directions, &by)) return k_unknown;
  const Eigen::MatrixXd turned =
      by.by_values - by.by_turn * by.by_turn.colPivHouseholderQr().solve(by.by_values);
  const Eigen::Index at = column_of(solution, camera), values = by.by_values.cols();
  const Eigen::MatrixXd covariance =
      turned * solution.covariance.block(at, at, values, values) * turned.transpose();
  std::vector<double> deviations;
  for (Eigen::Index i = 0; i < covariance.rows(); i += 2)
    deviations.push_back(std::sqrt(std::max(0.0, covariance(i, i) + covariance(i + 1, i + 1))));
  return quantile(std::move(deviations), k_share);
}

}  // namespace limn::calib
