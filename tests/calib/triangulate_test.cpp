#include "calib/surface/triangulate.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using namespace test;

struct Pair {
  Imager camera{"camera0", 1280, 1024,
                Lens::create("LENSMODEL_OPENCV4", {1600, 1600, 640, 512, -0.1, 0.03, 0, 0}).value(),
                looking_at({-0.3, 0, 0}, {0, 0, 1.4}, {0, -1, 0})};
  Imager projector{"projector0", 1280, 800,
                   Lens::create("LENSMODEL_OPENCV4", {1500, 1500, 640, 830, -0.05, 0.01, 0, 0}).value(),
                   looking_at({0.4, 0.1, 0}, {0, 0.5, 1.4}, {0, -1, 0})};
};

TEST(Triangulate, FindsThePointThroughBothLenses) {
  const Pair pair;
  const Vector3d p(0.05, -0.1, 1.3);
  const MeasuredPixel a{*pair.camera.project(p)}, b{*pair.projector.project(p)};
  const auto found = triangulate(pair.camera, pair.projector, a, b, {0, 0, 1});
  ASSERT_TRUE(found);
  EXPECT_TRUE(near(found->p_world, p, 1e-9));
  EXPECT_LT(found->epipolar_px, 1e-6);
}

TEST(Triangulate, CovarianceAndEpipolarResidualAreThoseOfTheNoise) {
  auto rng = test_rng();
  std::normal_distribution<double> normal;
  const Pair pair;
  const Vector3d p(0.05, -0.1, 1.3);
  const Vector2d sigma_a(0.05, 0.05), sigma_b(0.1, 0.3);
  double chi = 0, epipolar = 0;
  constexpr int k_draws = 2000;
  for (int i = 0; i < k_draws; ++i) {
    const auto noisy = [&](const Vector2d& px, const Vector2d& sigma) {
      return MeasuredPixel{px + sigma.cwiseProduct(Vector2d(normal(rng), normal(rng))), sigma.cwiseAbs2()};
    };
    const auto found = triangulate(pair.camera, pair.projector, noisy(*pair.camera.project(p), sigma_a),
                                   noisy(*pair.projector.project(p), sigma_b), p);
    ASSERT_TRUE(found);
    chi += (found->p_world - p).dot(found->covariance.inverse() * (found->p_world - p)) / 3 / k_draws;
    epipolar += found->epipolar_sigmas * found->epipolar_sigmas / k_draws;
  }
  EXPECT_NEAR(chi, 1, 0.08);       // sqrt(2 / 6000) = 0.018
  EXPECT_NEAR(epipolar, 1, 0.12);  // one degree of freedom: sqrt(2 / 2000) = 0.03
}

TEST(Triangulate, RaysThatPassEachOtherLeaveTheirDistanceInPixels) {
  const Pair pair;
  const Vector3d p(0.05, -0.1, 1.3);
  const MeasuredPixel a{*pair.camera.project(p)};
  MeasuredPixel b{*pair.projector.project(p)};
  b.px.y() += 10;  // projector and camera are side by side, so the rows of the rays must agree
  const auto found = triangulate(pair.camera, pair.projector, a, b, p);
  ASSERT_TRUE(found);
  EXPECT_GT(found->epipolar_px, 5);
  EXPECT_LT(found->epipolar_px, 10);
}

TEST(Triangulate, ParallelRaysHaveNoMiddle) {
  EXPECT_FALSE(midpoint({{0, 0, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, 0, 1}}));
  EXPECT_FALSE(midpoint({{0, 0, 0}, Vector3d(-0.1, 0, 1).normalized()},
                        {{1, 0, 0}, Vector3d(0.1, 0, 1).normalized()}));
  const auto middle =
      midpoint({{0, 0, 0}, Vector3d(1, 0, 2).normalized()}, {{1, 0, 0}, Vector3d(-1, 0, 2).normalized()});
  ASSERT_TRUE(middle);
  EXPECT_TRUE(near(*middle, Vector3d(0.5, 0, 1), 1e-12));
}

}  // namespace
}  // namespace limn::calib
