#pragma once

#include <Eigen/Core>
#include <span>

#include "core/pose.h"

namespace limn {

// Decompositions from Eigen that many files use. Each takes seconds to compile, so they are compiled only
// here.

/// Eigenvalues of a symmetric matrix, ascending, and their unit eigenvectors as columns.
struct EigenPairs6 {
  Vector6d values;
  Matrix6d vectors;
};
EigenPairs6 eigen_pairs(const Matrix6d& symmetric);

/// Solves `symmetric` x = b by L D L^T. The result is not finite when there is no solution.
Vector6d solve_ldlt(const Matrix6d& symmetric, const Vector6d& b);

/// The rotation R that is nearest to m: it minimises |R - m|. For m = sum of b_i a_i^T it also minimises the
/// distances between R a_i and b_i (Kabsch 1976).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m);

/// The pose a_from_b that minimises the sum of squares |a - a_from_b b| (Kabsch 1976). The points of each set
/// must not lie on a line.
Pose aligned(std::span<const Eigen::Vector3d> p_a, std::span<const Eigen::Vector3d> p_b);

/// The smallest rotation that turns the direction of `from` into the direction of `to`.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace limn
