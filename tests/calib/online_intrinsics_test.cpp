#include "calib/online_intrinsics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

constexpr int k_width = 640, k_height = 400;
constexpr double k_noise_px = 0.15;

using Rng = std::mt19937_64;
double normal(Rng* rng, double stddev) { return std::normal_distribution<double>(0, stddev)(*rng); }
double between(Rng* rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*rng);
}

// A lens of 60 to 70 degrees, off its centre, with the distortion that is left in images of phones.
IntrinsicsEstimate drawn_lens(Rng* rng) {
  IntrinsicsEstimate lens = prior_intrinsics(k_width, k_height, {.fov_deg = between(rng, 60, 70)});
  lens.values[1] += between(rng, -10, 10);
  lens.values[2] += between(rng, -10, 10);
  lens.values[3] = between(rng, -0.1, 0.1);
  lens.values[4] = between(rng, -0.05, 0.05);
  return lens;
}

// Eight markers of 40 mm, as on the door of the examples; `depth_m`: their distance from a plane.
std::vector<Eigen::Vector3d> markers(double depth_m) {
  std::vector<Eigen::Vector3d> points;
  constexpr double k_half = 0.02;
  for (int i = 0; i < 8; ++i) {
    const double x = -0.24 + 0.16 * (i % 4), y = i < 4 ? -0.15 : 0.08;
    for (const auto& [dx, dy] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
      points.emplace_back(x + k_half * dx, y + k_half * dy, depth_m * std::cos(7.0 * (x + y)));
  }
  return points;
}

// The pose of a camera that views the markers from about `distance_m`, up to `angle` off their normal,
// pointed up to `past_m` beside their centre.
Pose drawn_place(Rng* rng, double distance_m, double angle, double past_m = 0.1) {
  const double turn = between(rng, 0, 2 * std::numbers::pi), tilt = between(rng, 0, angle);
  const double distance = distance_m * between(rng, 0.75, 1.25);
  const Eigen::Vector3d p_eye = distance * Eigen::Vector3d(std::sin(tilt) * std::cos(turn),
                                                           std::sin(tilt) * std::sin(turn), -std::cos(tilt));
  const Eigen::Vector3d p_target(between(rng, -past_m, past_m), between(rng, -past_m, past_m), 0);
  return looking_at(p_eye, p_target, {0.1 * normal(rng, 1), -1, 0});
}

BodyView seen(const IntrinsicsEstimate& lens,
              const Pose& place,
              const std::vector<Eigen::Vector3d>& points,
              Rng* rng) {
  BodyView view{place, {}};
  view.camera_from_body.translation += Eigen::Vector3d(0.01, -0.01, 0.05);  // a rough initial pose
  const Lens true_lens = lens.lens();
  for (const Eigen::Vector3d& p : points) {
    const auto px = true_lens.project(place * p);
    if (!px || px->x() < 0 || px->y() < 0 || px->x() > k_width - 1 || px->y() > k_height - 1) continue;
    const Eigen::Vector2d off(normal(rng, k_noise_px), normal(rng, k_noise_px));
    view.points.push_back({p, *px + off, k_noise_px * k_noise_px * Eigen::Matrix2d::Identity()});
  }
  return view;
}

// The estimate after a camera has viewed the markers in this many images.
OnlineIntrinsics looked_round(const IntrinsicsEstimate& truth,
                              const IntrinsicsEstimate& before,
                              int images,
                              Rng* rng) {
  OnlineIntrinsics lens(before);
  for (int i = 0; i < images; ++i)
    if (lens.add(seen(truth, drawn_place(rng, 0.8, 0.9), markers(0.01), rng))) lens.improve();
  return lens;
}

TEST(OnlineIntrinsics, IsFoundWhileSomebodyLooksRoundAndSaysHowWell) {
  Rng rng = test::test_rng();
  constexpr int k_lenses = 20;
  double squares = 0, worst = 0;
  for (int i = 0; i < k_lenses; ++i) {
    const IntrinsicsEstimate truth = drawn_lens(&rng);
    const OnlineIntrinsics lens = looked_round(truth, prior_intrinsics(k_width, k_height), 100, &rng);
    const IntrinsicsEstimate& found = lens.estimate();
    EXPECT_LT(std::abs(found.values[0] - truth.values[0]), 0.005 * truth.values[0]);
    EXPECT_LT(found.focal_stddev_px(), 0.003 * truth.values[0]);
    EXPECT_LE(lens.views(), 40u);
    for (int k = 0; k < 5; ++k) {
      const double pull = (found.values[k] - truth.values[k]) / std::sqrt(found.covariance(k, k));
      squares += pull * pull;
      worst = std::max(worst, std::abs(pull));
    }
  }
  std::printf("normalised errors of the lens: RMS %.2f, worst %.2f\n", std::sqrt(squares / (5 * k_lenses)),
              worst);
  EXPECT_NEAR(std::sqrt(squares / (5 * k_lenses)), 1, 0.3);
  EXPECT_LT(worst, 4);
}

// Focal length and distance cannot be separated there.
TEST(OnlineIntrinsics, FlatMarkersFromStraightAheadLeaveTheFocalLengthUnsure) {
  Rng rng = test::test_rng();
  for (int i = 0; i < 5; ++i) {
    IntrinsicsEstimate truth = drawn_lens(&rng);
    OnlineIntrinsics lens(prior_intrinsics(k_width, k_height));
    for (int k = 0; k < 50; ++k)
      if (lens.add(seen(truth, drawn_place(&rng, 0.8, 0.01, 0), markers(0), &rng))) lens.improve();
    const double deviation = lens.estimate().focal_stddev_px();
    EXPECT_GT(deviation, 0.03 * truth.values[0]);
    EXPECT_LT(std::abs(lens.estimate().values[0] - truth.values[0]), 3 * deviation);
  }
}

TEST(OnlineIntrinsics, BeforeAnyImageItIsTheExpectedOneAndUnsure) {
  const OnlineIntrinsics lens(prior_intrinsics(k_width, k_height));
  EXPECT_NEAR(lens.estimate().values[0], 0.5 * k_width / std::tan(32.5 * std::numbers::pi / 180), 1e-9);
  EXPECT_GT(lens.estimate().focal_stddev_px(), 0.2 * lens.estimate().values[0]);
  EXPECT_EQ(lens.estimate().lens().model.name(), "LENSMODEL_OPENCV4");
}

TEST(OnlineIntrinsics, AMarkerThatWasMovedOnItsBodyChangesLittle) {
  Rng rng = test::test_rng();
  const IntrinsicsEstimate truth = drawn_lens(&rng);
  OnlineIntrinsics lens(prior_intrinsics(k_width, k_height));
  for (int i = 0; i < 80; ++i) {
    BodyView view = seen(truth, drawn_place(&rng, 0.8, 0.9), markers(0.01), &rng);
    // The stated position of the first marker is 20 mm right of the true one.
    for (BodyPoint& point : view.points)
      if (point.p_body.x() < -0.2 && point.p_body.y() < 0) point.p_body.x() += 0.02;
    if (lens.add(view)) lens.improve();
  }
  const IntrinsicsEstimate& found = lens.estimate();
  EXPECT_LT(std::abs(found.values[0] - truth.values[0]), 4 * found.focal_stddev_px());
  EXPECT_LT(std::abs(found.values[0] - truth.values[0]), 0.005 * truth.values[0]);
}

TEST(OnlineIntrinsics, ImprovesWithUseAndIsTheSameAtAnotherSize) {
  Rng rng = test::test_rng();
  const IntrinsicsEstimate truth = drawn_lens(&rng);
  const OnlineIntrinsics first = looked_round(truth, prior_intrinsics(k_width, k_height), 30, &rng);
  const OnlineIntrinsics second = looked_round(truth, first.estimate(), 30, &rng);
  EXPECT_LT(second.estimate().focal_stddev_px(), 0.9 * first.estimate().focal_stddev_px());
  EXPECT_GT(second.estimate().views, first.estimate().views);
  const auto half = truth.resized(k_width / 2, k_height / 2);
  ASSERT_TRUE(half.has_value());
  const Eigen::Vector3d p(0.1, -0.07, 0.5);
  const Eigen::Vector2d px = *truth.lens().project(p), px_half = *half->lens().project(p);
  EXPECT_LT((px_half - (0.5 * (px.array() + 0.5) - 0.5).matrix()).norm(), 1e-9);
  EXPECT_FALSE(truth.resized(400, 640).has_value());
}

// A stored estimate of another lens is dropped, at once or when the camera changes its lens during use.
TEST(OnlineIntrinsics, AnotherLensIsNoticed) {
  Rng rng = test::test_rng();
  IntrinsicsEstimate truth = drawn_lens(&rng);
  IntrinsicsEstimate other = truth;
  other.values[0] *= 0.7;
  OnlineIntrinsics lens = looked_round(other, prior_intrinsics(k_width, k_height), 60, &rng);
  const IntrinsicsEstimate stored = lens.estimate();
  for (int i = 0; i < 80; ++i)
    if (lens.add(seen(truth, drawn_place(&rng, 0.8, 0.9), markers(0.01), &rng))) lens.improve();
  EXPECT_LT(std::abs(lens.estimate().values[0] - truth.values[0]), 0.01 * truth.values[0]);
  const OnlineIntrinsics next = looked_round(truth, stored, 80, &rng);
  EXPECT_LT(std::abs(next.estimate().values[0] - truth.values[0]), 0.01 * truth.values[0]);
}

TEST(OnlineIntrinsics, ViewsThatAreNoneAreNotHeld) {
  Rng rng = test::test_rng();
  OnlineIntrinsics lens(prior_intrinsics(k_width, k_height));
  EXPECT_FALSE(lens.add({}));
  BodyView view = seen(drawn_lens(&rng), drawn_place(&rng, 0.8, 0.9), markers(0.01), &rng);
  view.points[3].px.x() = std::nan("");
  EXPECT_FALSE(lens.add(view));
  lens.improve();
  EXPECT_TRUE(lens.estimate().is_sound());
  IntrinsicsEstimate broken = prior_intrinsics(k_width, k_height);
  broken.covariance(0, 0) = -1;
  EXPECT_FALSE(broken.is_sound());
  broken = prior_intrinsics(k_width, k_height);
  broken.values[0] = std::nan("");
  EXPECT_FALSE(broken.is_sound());
}

}  // namespace
}  // namespace limn::calib
