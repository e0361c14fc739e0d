#include "core/camera_files/lens_fit.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace limn {

std::vector<double> fitted_values(const LensFormula& formula,
                                  std::vector<double> values,
                                  std::span<const LensSample> samples) {
  const auto count = static_cast<Eigen::Index>(values.size()),
             rows = 2 * static_cast<Eigen::Index>(samples.size());
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> jacobian(rows, count);
  Eigen::VectorXd residuals(rows);
  for (int iteration = 0; iteration < 20; ++iteration) {
    jacobian.setZero();
    residuals.setZero();
    Eigen::Index row = 0;
    for (const LensSample& sample : samples) {
      Eigen::Vector2d px;
      if (formula(values, sample.d, &px, jacobian.row(row).data()))
        residuals.segment<2>(row) = sample.px - px;
      row += 2;
    }
    Eigen::MatrixXd hessian = jacobian.transpose() * jacobian;
    Eigen::VectorXd gradient = jacobian.transpose() * residuals;
    hessian.diagonal().array() += 1e-9;
    constexpr double k_distortion_weight = 1e-2;  // (0.1 px / 1)^2
    for (Eigen::Index i = 4; i < count; ++i) {
      hessian(i, i) += k_distortion_weight;
      gradient[i] -= k_distortion_weight * values[static_cast<std::size_t>(i)];
    }
    const Eigen::VectorXd step = hessian.ldlt().solve(gradient);
    for (Eigen::Index i = 0; i < count; ++i) values[static_cast<std::size_t>(i)] += step[i];
    constexpr double k_settled_px = 1e-4;  // the next step would move pixels by far less
    const double moved_px = std::sqrt(step.dot(hessian * step) / static_cast<double>(samples.size()));
    if (!(moved_px > k_settled_px)) break;
  }
  return values;
}

double worst_distance_px(const LensFormula& formula,
                         std::span<const double> values,
                         std::span<const LensSample> samples) {
  double worst_px = 0;
  for (const LensSample& sample : samples) {
    Eigen::Vector2d px;
    const double distance = formula(values, sample.d, &px, nullptr) ? (px - sample.px).norm() : INFINITY;
    if (!(distance <= worst_px)) worst_px = distance;  // NaN is kept, too
  }
  return worst_px;
}

}  // namespace limn
