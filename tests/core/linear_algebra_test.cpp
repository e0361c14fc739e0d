#include "core/linear_algebra.h"

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace limn {
namespace {

Matrix6d random_matrix(std::mt19937_64* rng) {
  std::normal_distribution<double> normal;
  return Matrix6d::NullaryExpr([&] { return normal(*rng); });
}

TEST(LinearAlgebra, EigenPairsAscendAndMakeTheMatrix) {
  auto rng = test::test_rng();
  const Matrix6d root = random_matrix(&rng), symmetric = root + root.transpose();
  const EigenPairs6 pairs = eigen_pairs(symmetric);
  for (int i = 0; i < 5; ++i) EXPECT_LE(pairs.values[i], pairs.values[i + 1]);
  EXPECT_LT((pairs.vectors * pairs.values.asDiagonal() * pairs.vectors.transpose() - symmetric).norm(),
            1e-12);
  EXPECT_LT((pairs.vectors.transpose() * pairs.vectors - Matrix6d::Identity()).norm(), 1e-12);
}

TEST(LinearAlgebra, SolvesSymmetricEquations) {
  auto rng = test::test_rng();
  const Matrix6d root = random_matrix(&rng);
  const Vector6d b = root.col(0);
  const Matrix6d definite = root * root.transpose() + Matrix6d::Identity(),
                 indefinite = root + root.transpose();
  for (const Matrix6d& symmetric : {definite, indefinite})
    EXPECT_LT((symmetric * solve_ldlt(symmetric, b) - b).norm(), 1e-11);
}

TEST(LinearAlgebra, NearestRotationIsOneAndIsFoundInNoise) {
  const Eigen::Matrix3d turned = exp_rotation({0.3, -1.2, 0.8}).toRotationMatrix();
  EXPECT_LT(
      (nearest_rotation(turned * Eigen::Vector3d(3, 2, 0.5).asDiagonal() * turned.transpose() * turned) -
       turned)
          .norm(),
      1e-12);
  const Eigen::Matrix3d mirrored = turned * Eigen::Vector3d(1, 1, -0.1).asDiagonal();
  EXPECT_LT((nearest_rotation(mirrored) - turned).norm(), 1e-12);  // a rotation, not a reflection
}

TEST(LinearAlgebra, TurnsOneDirectionIntoAnother) {
  const Eigen::Vector3d from(0.2, -3, 1), to(-4, 0.1, 0.3);
  const Eigen::Quaterniond turn = rotation_between(from, to);
  EXPECT_LT((turn * from.normalized() - to.normalized()).norm(), 1e-14);
  EXPECT_NEAR(turn.vec().dot(from), 0, 1e-12);  // the smallest rotation has an axis perpendicular to both
  EXPECT_NEAR(turn.vec().dot(to), 0, 1e-12);
}

}  // namespace
}  // namespace limn
