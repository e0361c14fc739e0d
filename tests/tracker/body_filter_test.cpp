#include "tracker/body_filter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstdio>
#include <opencv2/core.hpp>

#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/marker_images.h"
#include "tests/tracker/seen_body.h"
#include "tracker/detector.h"
#include "tracker/predict.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::body_of;
using test::camera_1080p;
using test::detections_of;
using test::uniform;

constexpr double k_frame_s = 1 / 30.0;

Stamp at(double seconds) { return shifted(Stamp{}, seconds); }

std::vector<BodyFilter> step(const std::vector<BodyFilter>& known,
                             const Body& body,
                             const Imager& camera,
                             std::span<const Detection> detections,
                             double seconds) {
  const View view{&camera, detections};
  return observed(known, std::span(&body, 1), std::span(&view, 1), at(seconds));
}

// A marker whose tilt against its own line of sight varies between 10 and 60 degrees, towards changing sides.
class Tilting {
 public:
  Tilting(double depth, std::mt19937_64& rng)
      : depth_(depth),
        rate_(2 * M_PI * uniform(rng, 0.1, 0.4)),
        phase_(uniform(rng, 0, 6.28)),
        towards_(uniform(rng, 0, 6.28)),
        towards_rate_(uniform(rng, -0.5, 0.5)),
        spin_(uniform(rng, 0, 6.28)),
        spin_rate_(uniform(rng, -0.5, 0.5)),
        place_(uniform(rng, -0.3, 0.3), uniform(rng, -0.2, 0.2), 1) {}

  Pose at(double t) const {
    const double tilt = 35_deg + 25_deg * std::sin(rate_ * t + phase_);
    const double a = towards_ + towards_rate_ * t;
    const Eigen::Vector3d p =
        depth_ * place_ + 0.1 * Eigen::Vector3d(std::sin(1.7 * t), std::cos(1.3 * t), 0);
    return Pose(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), p) *
                    exp_rotation(tilt * Eigen::Vector3d(std::cos(a), std::sin(a), 0)) *
                    exp_rotation({0, 0, spin_ + spin_rate_ * t}),
                p);
  }

 private:
  double depth_, rate_, phase_, towards_, towards_rate_, spin_, spin_rate_;
  Eigen::Vector3d place_;
};

// Whether a pose is nearer to the true pose's mirror image along the line of sight than to the true pose.
bool is_flipped(const Pose& found, const Pose& truth) {
  const Eigen::Vector3d d_sight = truth.translation.normalized();
  const Eigen::Vector3d d_true = truth.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d d_mirrored = 2 * d_true.dot(d_sight) * d_sight - d_true;
  const Eigen::Vector3d d_found = found.rotation * Eigen::Vector3d::UnitZ();
  return d_found.dot(d_mirrored) > d_found.dot(d_true);
}

// The minima are the same with a correct prediction, with a wrong one and with none.
TEST(Minima, AreTheSameFromWhereverTheyAreLookedFor) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  int second = 0;
  for (int i = 0; i < 60; ++i) {
    const Body body = body_of(i % 2 ? 1 : 4);
    const Pose truth = Tilting(uniform(rng, 1, 2), rng).at(i);
    const auto detections = detections_of(body, camera, truth, 0.2, rng);
    const View view{&camera, detections};
    const BodyCorrespondences seen = correspondences(body, std::span(&view, 1));
    const std::vector<PoseFit> alone = minima(seen);
    ASSERT_FALSE(alone.empty());
    std::vector<Pose> near, far = {Pose(exp_rotation({2, 1, 0.5}), {0.4, 0.3, 3})};
    for (const PoseFit& fit : alone) {
      const Vector6d off = 0.01 * Vector6d::Random();
      near.push_back(boxplus(fit.world_from_body, off));
    }
    std::reverse(near.begin(), near.end());
    second += alone.size() == 2;
    for (const std::vector<Pose>& predictions : {near, std::vector{near.back()}, far}) {
      const std::vector<PoseFit> found = minima(seen, predictions);
      ASSERT_EQ(found.size(), alone.size()) << i;
      for (std::size_t k = 0; k < found.size(); ++k) {
        const Vector6d off = boxminus(found[k].world_from_body, alone[k].world_from_body);
        if (alone[k].chi_square > 500) continue;  // bad fit: left before convergence
        EXPECT_LT(std::sqrt(off.dot(alone[k].covariance.inverse() * off)), 0.01) << i;
      }
    }
  }
  EXPECT_GE(second, 20);
}

TEST(BodyFilter, NeverFlipsOnceItHasASecondOfHistory) {
  auto rng = test::test_rng();
  // 24 px; 0.1 px along each axis is the 0.14 px RMS of docs/measurements.md for small markers.
  const Imager camera = {"camera0", 1280, 960, Lens::pinhole(1200, 1200, 639.5, 479.5), Pose{}};
  const Body body = body_of(1);
  int frames = 0, alone = 0, with_history = 0;
  for (int round = 0; round < 40; ++round) {
    const Tilting truth(1200 * 0.04 / 24, rng);
    std::vector<BodyFilter> known;
    for (int i = 0; i < 290; ++i) {
      const Pose world_from_body = truth.at(i * k_frame_s);
      known =
          step(known, body, camera, detections_of(body, camera, world_from_body, 0.1, rng), i * k_frame_s);
      ASSERT_EQ(known.size(), 1u);
      if (i < 30) continue;
      ++frames;
      alone += is_flipped(known[0].fixes.back().world_from_body, world_from_body);
      with_history += is_flipped(predicted(known, at(i * k_frame_s))[0].world_from_body, world_from_body);
    }
  }
  std::printf("%d frames at 24 px, 10-60 degrees: %d flips with history\n", frames, with_history);
  EXPECT_GT(frames, 10000);
  EXPECT_EQ(with_history, 0);
}

TEST(BodyFilter, CarriesBothBranchesUntilHistoryTellsThemApart) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  const Body body = body_of(1);
  const Pose truth(exp_rotation({0.5, 0, 0}), {0, 0, 2.4});  // 27 px
  std::vector<BodyFilter> known;
  for (int i = 0; i < 90; ++i) {
    known = step(known, body, camera, detections_of(body, camera, truth, 0.1, rng), i * k_frame_s);
    ASSERT_EQ(known[0].branches.size(), 2u);
    EXPECT_NEAR(known[0].branches[0].weight + known[0].branches[1].weight, 1, 1e-9);
  }
  EXPECT_GT(known[0].branches[0].weight, 0.999);
  EXPECT_GT(known[0].branches[1].weight, 0);
  EXPECT_TRUE(test::pose_near(known[0].branches[0].still.world_from_body, truth, 1_deg, 3_mm));
  EXPECT_GT(angle_between(known[0].branches[1].still.world_from_body.rotation, truth.rotation), 20_deg);
}

struct Errors {
  double hold_mm = 0, linear_mm = 0, filtered_mm = 0, normalised = 0;
};

// RMS errors of the predicted position 60 ms after each image, for a body in a moving hand.
Errors prediction_errors(int markers, double depth, double noise_px, std::mt19937_64& rng) {
  constexpr double k_ahead_s = 0.06;
  const Imager camera = camera_1080p();
  const Body body = body_of(markers);
  std::array<double, 3> squares = {};
  double normalised = 0;
  int count = 0;
  for (int round = 0; round < 8; ++round) {
    const double a = uniform(rng, 0, 6.28);
    const test::HandMotion hand(
        Pose(exp_rotation(25_deg * Eigen::Vector3d(std::cos(a), std::sin(a), 0)), {0.05, 0.02, depth}), rng);
    std::vector<BodyFilter> known;
    for (int i = 0; i < 240; ++i) {
      const double now = i * k_frame_s;
      known = step(known, body, camera, detections_of(body, camera, hand.at(now), noise_px, rng), now);
      if (i < 30) continue;
      const auto error = [&](Prediction how, Track* track) {
        *track = predicted(known, at(now + k_ahead_s), how)[0];
        return boxminus(track->world_from_body, hand.at(now + k_ahead_s));
      };
      Track track;
      squares[0] += error(Prediction::hold, &track).tail<3>().squaredNorm();
      squares[1] += error(Prediction::linear, &track).tail<3>().squaredNorm();
      const Vector6d filtered = error(Prediction::filtered, &track);
      squares[2] += filtered.tail<3>().squaredNorm();
      normalised += filtered.dot(track.covariance.inverse() * filtered) / 6;
      ++count;
    }
  }
  const auto rms_mm = [&](double sum) { return 1e3 * std::sqrt(sum / count); };
  const Errors errors = {rms_mm(squares[0]), rms_mm(squares[1]), rms_mm(squares[2]), normalised / count};
  std::printf(
      "%d marker(s) at %.1f m, %.2f px, 60 ms ahead: hold %.2f, linear %.2f, filtered %.2f mm (%.0f %% "
      "better)\n",
      markers, depth, noise_px, errors.hold_mm, errors.linear_mm, errors.filtered_mm,
      100 * (1 - errors.filtered_mm / errors.hold_mm));
  return errors;
}

TEST(Predicted, BodyInAHandIs85PercentBetterThanHeldAndWithin1_5mm) {
  auto rng = test::test_rng();
  for (const auto& [depth, noise_px] : {std::pair(1.2, 0.1), std::pair(1.6, 0.1), std::pair(1.2, 0.03)}) {
    const Errors errors = prediction_errors(4, depth, noise_px, rng);
    EXPECT_GT(errors.hold_mm, 14);
    EXPECT_LT(errors.filtered_mm, 0.15 * errors.hold_mm);
    EXPECT_LT(errors.filtered_mm, 1.5);
    EXPECT_LT(errors.filtered_mm, errors.linear_mm);
    EXPECT_LT(errors.normalised, 1.5);  // the stated covariance is not too small
  }
}

TEST(Predicted, LoneMarkerInAHandIsLimitedByItsDepthNoise) {
  auto rng = test::test_rng();
  const Errors errors = prediction_errors(1, 1, 0.05, rng);
  EXPECT_LT(errors.filtered_mm, 0.15 * errors.hold_mm);
  EXPECT_LT(errors.normalised, 1.5);
}

TEST(BodyFilter, HasTheCovarianceOfItsErrorsWhileMoving) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  const Body body = body_of(4);
  double normalised = 0;
  int count = 0;
  for (int round = 0; round < 10; ++round) {
    const test::HandMotion hand(Pose(exp_rotation({0.4, 0.1, 0}), {0, 0, 1.2}), rng);
    std::vector<BodyFilter> known;
    for (int i = 0; i < 150; ++i) {
      const double now = i * k_frame_s;
      known = step(known, body, camera, detections_of(body, camera, hand.at(now), 0.1, rng), now);
      if (i < 30) continue;
      const Track track = predicted(known, at(now))[0];
      const Vector6d error = boxminus(track.world_from_body, hand.at(now));
      normalised += error.dot(track.covariance.inverse() * error) / 6;
      ++count;
    }
  }
  EXPECT_NEAR(normalised / count, 1, 0.2);
}

// Scatter about the mean, RMS of the vector, of the poses reported in seconds 2 to 8.
TEST(BodyFilter, StillMarkerOf64PixelsJittersByLessThanATenth) {
  auto rng = test::test_rng();
  const Lens lens = Lens::pinhole(1600, 1600, 99.5, 99.5);
  const Imager camera = {"camera0", 200, 200, lens, Pose{}};
  for (const double tilt_deg : {0, 5, 15, 30, 45}) {
    test::PlacedMarker marker =
        test::placed(lens, {"aruco_4x4_50", "0"}, {103.3, 98.6}, 64, 0.3, tilt_deg * 1_deg, 0.8);
    marker.camera_from_marker.translation *= 0.04 / marker.size_m;
    marker.size_m = 0.04;
    const cv::Mat clean =
        test::image_of(lens, test::plain(200, 200, 110), std::span(&marker, 1), {.blur_px = 0.7}, rng);
    const std::vector<std::string> family = {"aruco_4x4_50"};
    Detector detector(Families::load(family).value());
    const Body body = body_of(1);
    std::vector<BodyFilter> known;
    std::vector<Pose> poses;
    for (int i = 0; i < 240; ++i) {
      cv::Mat noise(clean.size(), CV_16S), noisy;
      cv::theRNG().state = rng();
      cv::randn(noise, 0, 2);
      cv::add(clean, noise, noisy, cv::noArray(), CV_8U);
      known = step(known, body, camera, detector.detect(noisy, &lens), i * k_frame_s);
      ASSERT_EQ(known.size(), 1u);
      if (i >= 60) poses.push_back(predicted(known, at(i * k_frame_s))[0].world_from_body);
    }
    Vector6d mean = Vector6d::Zero(), squares = mean;
    for (const Pose& pose : poses) mean += boxminus(pose, poses[0]) / static_cast<double>(poses.size());
    for (const Pose& pose : poses)
      squares += (boxminus(pose, poses[0]) - mean).cwiseAbs2() / static_cast<double>(poses.size());
    const double turn_deg = std::sqrt(squares.head<3>().sum()) / 1_deg;
    const double shift_mm = 1e3 * std::sqrt(squares.tail<3>().sum());
    std::printf("still, 64 px, tilt %2.0f: %.3f mm, %.3f degrees\n", tilt_deg, shift_mm, turn_deg);
    EXPECT_LT(shift_mm, 0.1);
    EXPECT_LT(turn_deg, 0.1);
  }
}

TEST(Predicted, UnseenBodyIsExtrapolatedThenLostAtTheLimit) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  const Body body = body_of(4);
  const test::HandMotion hand(Pose(exp_rotation({0.4, 0.1, 0}), {0, 0, 1.2}), rng);
  std::vector<BodyFilter> known;
  double now = 0;
  for (; now < 1; now += k_frame_s)
    known = step(known, body, camera, detections_of(body, camera, hand.at(now), 0.1, rng), now);
  const double seen = now - k_frame_s;
  EXPECT_EQ(predicted(known, at(now))[0].tracking, TrackingState::measured);
  double before = 0;
  for (; now < seen + 0.29; now += k_frame_s) {
    known = step(known, body, camera, {}, now);
    const Track track = predicted(known, at(now))[0];
    EXPECT_EQ(track.tracking, TrackingState::extrapolated);
    EXPECT_EQ(track.captured_at, at(seen));
    EXPECT_EQ(track.at, at(now));
    EXPECT_GT(track.covariance(3, 3), before);
    before = track.covariance(3, 3);
    const Vector6d error = boxminus(track.world_from_body, hand.at(now));
    EXPECT_LT(error.dot(track.covariance.inverse() * error), 22.5)
        << now - seen;  // 99.9 % of six degrees of freedom
  }
  for (const auto how : {Prediction::hold, Prediction::linear, Prediction::filtered}) {
    EXPECT_EQ(predicted(known, at(seen + 0.299), how)[0].tracking, TrackingState::extrapolated);
    EXPECT_EQ(predicted(known, at(seen + 0.301), how)[0].tracking, TrackingState::lost);
  }
  now = seen + 2;  // elsewhere, after a long time: starts anew at once
  known = step(known, body, camera, detections_of(body, camera, hand.at(now), 0.1, rng), now);
  EXPECT_EQ(predicted(known, at(now))[0].tracking, TrackingState::measured);
  EXPECT_TRUE(test::pose_near(predicted(known, at(now))[0].world_from_body, hand.at(now), 1_deg, 2_mm));
}

TEST(BodyFilter, IsFilteredAndNotLostWhereACameraTakesTwoImagesASecond) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  const Body body = body_of(1);
  const Pose truth(exp_rotation({0.4, 0.1, 0}), {0.05, 0, 1.2});
  constexpr double k_every_s = 0.5;
  std::vector<BodyFilter> known;
  double filtered = 0, alone = 0, now = 0;
  for (int i = 0; i < 80; ++i) {
    now = k_every_s * i;
    known = step(known, body, camera, detections_of(body, camera, truth, 0.1, rng), now);
    ASSERT_EQ(known.size(), 1u);
    if (i < 20) continue;
    EXPECT_NE(predicted(known, at(now + 0.49))[0].tracking, TrackingState::lost);
    filtered += boxminus(predicted(known, at(now))[0].world_from_body, truth).tail<3>().squaredNorm();
    alone += boxminus(known[0].fixes.back().world_from_body, truth).tail<3>().squaredNorm();
  }
  EXPECT_LT(filtered, 0.25 * alone);
  EXPECT_EQ(predicted(known, at(now + 0.74))[0].tracking, TrackingState::measured);
  EXPECT_GT(predicted(known, at(now + 0.74))[0].covariance(3, 3),
            predicted(known, at(now + 0.3))[0].covariance(3, 3));
  EXPECT_EQ(predicted(known, at(now + 0.76))[0].tracking, TrackingState::lost);
}

TEST(BodyFilter, PassesOverAFalseMarkerButBelievesTwo) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  const Body body = body_of(1);
  const Pose truth(exp_rotation({0.4, 0.1, 0}), {0, 0, 1}),
      elsewhere(exp_rotation({-0.3, 0.2, 1}), {0.2, 0.1, 1.1});
  std::vector<BodyFilter> known;
  double now = 0;
  for (; now < 1; now += k_frame_s)
    known = step(known, body, camera, detections_of(body, camera, truth, 0.05, rng), now);
  known = step(known, body, camera, detections_of(body, camera, elsewhere, 0.05, rng), now);
  EXPECT_TRUE(test::pose_near(predicted(known, at(now))[0].world_from_body, truth, 1_deg, 1_mm));
  EXPECT_EQ(predicted(known, at(now))[0].tracking, TrackingState::extrapolated);
  now += k_frame_s;
  known = step(known, body, camera, detections_of(body, camera, elsewhere, 0.05, rng), now);
  EXPECT_TRUE(test::pose_near(predicted(known, at(now))[0].world_from_body, elsewhere, 1.5_deg, 3_mm));
}

// A patch of light shifts all corners of one image towards the other branch.
TEST(BodyFilter, OneImageDoesNotOutweighASecond) {
  auto rng = test::test_rng();
  const Imager camera = {"camera0", 1280, 960, Lens::pinhole(1200, 1200, 639.5, 479.5), Pose{}};
  const Body body = body_of(1);
  const Pose truth(exp_rotation({15_deg, 0, 0}), {0, 0, 2}),
      mirrored(exp_rotation({-15_deg, 0, 0}), {0, 0, 2});
  std::vector<BodyFilter> known;
  double now = 0;
  const auto see = [&](const Pose& pose) {
    known = step(known, body, camera, detections_of(body, camera, pose, 0.02, rng), now += k_frame_s);
    return is_flipped(predicted(known, at(now))[0].world_from_body, truth);
  };
  while (now < 1) see(truth);
  EXPECT_FALSE(see(truth));
  EXPECT_FALSE(see(mirrored));
  EXPECT_FALSE(see(truth));
  bool is_believed = false;
  for (int i = 0; i < 20; ++i) is_believed = see(mirrored);
  EXPECT_TRUE(is_believed);
}

TEST(BodyFilter, IgnoresStaleImagesAndUnknownBodies) {
  auto rng = test::test_rng();
  const Imager camera = camera_1080p();
  const Body body = body_of(1);
  const Pose truth(exp_rotation({0.4, 0.1, 0}), {0, 0, 1}), old(exp_rotation({0.4, 0.1, 0}), {0.1, 0, 1});
  EXPECT_TRUE(step({}, body, camera, {}, 0).empty());
  const auto known = step({}, body, camera, detections_of(body, camera, truth, 0.05, rng), 1);
  const auto after = step(known, body, camera, detections_of(body, camera, old, 0.05, rng), 0.9);
  EXPECT_EQ(after[0].looked_at, at(1));
  EXPECT_TRUE(test::pose_near(predicted(after, at(1))[0].world_from_body, truth, 2_deg, 3_mm));
}

TEST(Predicted, LinearContinuesTheLastTwoImagesAndHoldStays) {
  const Pose first(exp_rotation({0.1, 0, 0}), {0, 0, 1}), second(exp_rotation({0.2, 0, 0}), {0.01, 0, 1});
  BodyFilter motion;
  motion.branches.resize(1);
  motion.fixes = {{first, 1e-6 * Matrix6d::Identity(), at(0)},
                  {second, 1e-6 * Matrix6d::Identity(), at(0.1)}};
  motion.measured_at = motion.looked_at = at(0.1);
  const Track linear = predicted(std::span(&motion, 1), at(0.2), Prediction::linear)[0];
  EXPECT_TRUE(
      test::pose_near(linear.world_from_body, Pose(exp_rotation({0.3, 0, 0}), {0.02, 0, 1}), 1e-9, 1e-9));
  EXPECT_GT(linear.covariance(3, 3), 5e-6);
  const Track held = predicted(std::span(&motion, 1), at(0.2), Prediction::hold)[0];
  EXPECT_TRUE(test::pose_near(held.world_from_body, second, 1e-9, 1e-9));
  EXPECT_NEAR(std::sqrt(held.covariance(3, 3)), 0.025, 1e-3);
}

}  // namespace
}  // namespace limn::tracker
