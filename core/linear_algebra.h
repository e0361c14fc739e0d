#pragma once

#include <Eigen/Core>

#include "core/pose.h"

namespace limn {

// Decompositions of Eigen's that many files want and that take the compiler seconds each: compiled once.

/// Of a symmetric matrix: eigenvalues, ascending, and their unit eigenvectors, in columns.
struct EigenPairs6 {
  Vector6d values;
  Matrix6d vectors;
};
EigenPairs6 eigen_pairs(const Matrix6d& symmetric);

/// x with `symmetric` x = b, by L D L^T. Not finite where there is none.
Vector6d solve_ldlt(const Matrix6d& symmetric, const Vector6d& b);

/// The rotation R that is nearest to m: it minimises |R - m|, and so the distances of R a_i from b_i where
/// m = sum of b_i a_i^T (Kabsch 1976).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m);

/// The shortest turn that brings the direction of `from` to that of `to`.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace limn
