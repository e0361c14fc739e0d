#include "calib/judge/smooth_errors.h"

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

namespace limn::calib {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;

constexpr Eigen::Index k_terms = 6;  // a polynomial of degree 2 has so many
constexpr Eigen::Index k_least_matches = 3 * k_terms;

// Orthonormal polynomials of the camera's pixel, matches x terms.
MatrixXd polynomials(const Observations& observations, const std::vector<size_t>& matches) {
  const auto n = static_cast<Eigen::Index>(matches.size());
  Vector2d middle = Vector2d::Zero();
  for (const size_t match : matches) middle += observations.matches[match].px_camera / static_cast<double>(n);
  double size = 1;
  for (const size_t match : matches)
    size = std::max(size, (observations.matches[match].px_camera - middle).cwiseAbs().maxCoeff());
  MatrixXd terms(n, k_terms);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector2d p = (observations.matches[matches[static_cast<size_t>(i)]].px_camera - middle) / size;
    terms.row(i) << 1, p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y();
  }
  return Eigen::HouseholderQR<MatrixXd>(terms).householderQ() * MatrixXd::Identity(n, k_terms);
}

}  // namespace

std::vector<SmoothErrors> smooth_errors(const Observations& observations,
                                        const Solution& solution,
                                        const CrossValidation& held_out) {
  std::map<std::tuple<int, int, int>, std::vector<size_t>> groups;  // pose, projector, camera
  for (size_t i = 0; i < observations.matches.size(); ++i) {
    const Match& match = observations.matches[i];
    if (held_out.residuals[i].allFinite() && !solution.match_outlier[i])
      groups[{match.pose, match.projector, match.camera}].push_back(i);
  }
  std::vector<SmoothErrors> all;
  for (auto& [key, matches] : groups) {
    const auto n = static_cast<Eigen::Index>(matches.size());
    if (n < k_least_matches) continue;
    const MatrixXd terms = polynomials(observations, matches);
    Eigen::MatrixX2d residuals(n, 2);
    for (Eigen::Index i = 0; i < n; ++i)
      residuals.row(i) = held_out.residuals[matches[static_cast<size_t>(i)]].transpose();
    SmoothErrors group{std::get<0>(key), std::get<1>(key), std::move(matches),
                       terms * (terms.transpose() * residuals), 0};
    const double rough = (residuals - group.residuals).squaredNorm();
    group.noise = rough * static_cast<double>(k_terms) / static_cast<double>(n - k_terms);
    all.push_back(std::move(group));
  }
  return all;
}

}  // namespace limn::calib
