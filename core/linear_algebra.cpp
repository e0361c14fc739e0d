#include "core/linear_algebra.h"

#include <Eigen/Dense>

namespace limn {

EigenPairs6 eigen_pairs(const Matrix6d& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

namespace {

// Solves m x = b by L D L^T without pivoting; false when the matrix may not be positive definite.
bool solve_definite(const Matrix6d& m, const Vector6d& b, Vector6d* x) {
  constexpr double k_least_pivot = 1e-12;  // as a share of the diagonal element
  Matrix6d l, ld;
  for (int j = 0; j < 6; ++j) {
    for (int i = j; i < 6; ++i) {
      double sum = m(i, j);
      for (int k = 0; k < j; ++k) sum -= l(i, k) * ld(j, k);
      ld(i, j) = sum;
    }
    if (!(ld(j, j) > k_least_pivot * m(j, j))) return false;
    for (int i = j; i < 6; ++i) l(i, j) = ld(i, j) / ld(j, j);
  }
  *x = b;
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < i; ++k) (*x)[i] -= l(i, k) * (*x)[k];
  for (int i = 5; i >= 0; --i) {
    (*x)[i] /= ld(i, i);
    for (int k = i + 1; k < 6; ++k) (*x)[i] -= l(k, i) * (*x)[k];
  }
  return true;
}

}  // namespace

Vector6d solve_ldlt(const Matrix6d& symmetric, const Vector6d& b) {
  Vector6d x;
  return solve_definite(symmetric, b, &x) ? x : Vector6d(symmetric.ldlt().solve(b));
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d& u = svd.matrixU();
  const Eigen::Matrix3d& v = svd.matrixV();
  const double sign = (u * v.transpose()).determinant() < 0 ? -1 : 1;
  return u * Eigen::Vector3d(1, 1, sign).asDiagonal() * v.transpose();
}

Pose aligned(std::span<const Eigen::Vector3d> p_a, std::span<const Eigen::Vector3d> p_b) {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = mean_a;
  for (std::size_t i = 0; i < p_a.size(); ++i) mean_a += p_a[i], mean_b += p_b[i];
  mean_a /= static_cast<double>(p_a.size()), mean_b /= static_cast<double>(p_b.size());
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < p_a.size(); ++i) moment += (p_a[i] - mean_a) * (p_b[i] - mean_b).transpose();
  const Eigen::Matrix3d rotation = nearest_rotation(moment);
  return {rotation, mean_a - rotation * mean_b};
}

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace limn
