#include "core/linear_algebra.h"

#include <Eigen/Dense>

namespace limn {

EigenPairs6 eigen_pairs(const Matrix6d& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Vector6d solved(const Matrix6d& symmetric, const Vector6d& b) { return symmetric.ldlt().solve(b); }

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d& u = svd.matrixU();
  const Eigen::Matrix3d& v = svd.matrixV();
  const double sign = (u * v.transpose()).determinant() < 0 ? -1 : 1;
  return u * Eigen::Vector3d(1, 1, sign).asDiagonal() * v.transpose();
}

Eigen::Quaterniond turn_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace limn
