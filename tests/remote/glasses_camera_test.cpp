// Glasses without a marker on them: registered by the scene's markers in the pictures of their own camera.
#include <gtest/gtest.h>

#include "remote/glasses/glasses_registration.h"
#include "remote/tablet/pose_by_lens.h"
#include "tests/remote/a_headset.h"
#include "tests/support/matchers.h"
#include "tracker/marker_pose.h"
#include "tracker/pose_fit.h"

namespace limn::remote {
namespace {

using Eigen::Vector3d;
using test::Headset;
using test::k_degree;

constexpr double k_corner_px = 0.1;
constexpr int k_view_every = 4;  // of 30 poses a second
constexpr int k_width = 960, k_height = 720;

// A person whose glasses have a camera of 960 x 720 pixels: it sees six markers of 60 mm about 1 m away
// with noise at each corner, and the browser states its pose and its lens not quite as they are.
class Wearer {
 public:
  explicit Wearer(std::uint64_t seed) : headset(seed), rng_(seed + 1) {
    headset.is_marker_seen = false;
    headset.turn_rad = 0.35;
    headset.nod_rad = 0.25;
    headset.walk_m = 0.25;
    eye_from_camera_ = Pose(exp_rotation(test::random_vector(rng_, 0.1)), {0.03, 0.01, -0.02});
    const Vector6d off = test::noise(rng_, 0.5e-3, 0.3e-3);
    stated_from_camera_ = boxplus(Pose(), off);
    const double fx = 840;
    const auto lens = [&](double focal, double x, double y) {
      return Lens::create("LENSMODEL_PINHOLE", {focal, focal, x, y}).value();
    };
    stated_ = lens(fx, 0.5 * (k_width - 1), 0.5 * (k_height - 1));
    std::normal_distribution<double> normal;
    true_ = lens(fx * (1 + 1e-3 * normal(rng_)), 0.5 * (k_width - 1) + 1e-3 * fx * normal(rng_),
                 0.5 * (k_height - 1) + 1e-3 * fx * normal(rng_));
    for (int i = 0; i < 6; ++i) {
      const Pose world_from_marker(Eigen::Quaterniond(Eigen::AngleAxisd(-k_degree * 90, Vector3d::UnitX())) *
                                       exp_rotation(test::random_vector(rng_, 0.5)),
                                   {0.25 * (i % 3 - 1), 0.2 * (i % 2) - 0.6, 0.3 + 0.3 * (i / 3)});
      for (const Vector3d& corner : tracker::square_corners(0.06))
        p_corners_.push_back(world_from_marker * corner);
    }
  }

  void play(double until_s, GlassesRegistration* registration) {
    headset.play(
        until_s,
        [&](const Pose& feed, double page_s, double received_s) {
          const Eigen::Quaterniond& q = feed.rotation;
          EXPECT_TRUE(
              registration->add_eye({q.w(), q.x(), q.y(), q.z()}, feed.translation, page_s, received_s));
          if (++poses_ % k_view_every != 0 || !looks) return;
          if (const auto view = seen(feed, page_s)) registration->add_view(*view);
        },
        [](const MeasuredMarker&) {}, [&](double at_s) { registration->update(at_s); });
  }

  bool looks = true;
  Headset headset;

 private:
  // What the picture of this moment gives; nullopt: too few corners are in it.
  std::optional<MeasuredView> seen(const Pose& feed_from_eye, double page_s) {
    const Pose turned(Eigen::Quaterniond(0, 1, 0, 0), Vector3d::Zero());
    const Pose world_from_stated = headset.world_from_eye(headset.at_s()) * eye_from_camera_;
    const Pose camera_from_world = (world_from_stated * stated_from_camera_ * turned).inverse();
    std::normal_distribution<double> normal(0, k_corner_px);
    std::vector<tracker::PointObservation> corners;
    for (const Vector3d& p : p_corners_) {
      const auto px = true_.project(camera_from_world * p);
      if (!px || px->x() < 0 || px->y() < 0 || px->x() > k_width - 1 || px->y() > k_height - 1) continue;
      corners.push_back({&stated_, Pose(), p, *px + Eigen::Vector2d(normal(rng_), normal(rng_)),
                         Eigen::Matrix2d::Identity() / (k_corner_px * k_corner_px)});
    }
    if (corners.size() < 8) return std::nullopt;
    const auto fit = tracker::fit_pose(corners, camera_from_world);
    if (!fit) return std::nullopt;
    MeasuredView view{page_s, feed_from_eye * eye_from_camera_, fit->world_from_body, fit->covariance};
    view.by_lens = pose_by_lens(corners, *fit);
    return view;
  }

  std::mt19937_64 rng_;
  Pose eye_from_camera_, stated_from_camera_;
  Lens stated_, true_;
  std::vector<Vector3d> p_corners_;
  int poses_ = 0;
};

GlassesRegistration by_camera() { return GlassesRegistration("", camera_options()); }

TEST(GlassesCamera, FindsTheRoomWithinTenSecondsOfLookingRound) {
  auto rng = test::test_rng();
  double worst_m = 0, worst_rad = 0, longest_s = 0;
  for (int round = 0; round < 20; ++round) {
    Wearer wearer(rng());
    GlassesRegistration registration = by_camera();
    double needed_s = 100;
    while (wearer.headset.at_s() < 110) {
      wearer.play(wearer.headset.at_s() + 0.1, &registration);
      if (registration.place()) needed_s = std::min(needed_s, wearer.headset.at_s() - 100);
    }
    ASSERT_TRUE(registration.place()) << registration.advice();
    const Vector6d off = wearer.headset.error_of(*registration.place());
    worst_m = std::max(worst_m, off.tail<3>().norm());
    worst_rad = std::max(worst_rad, off.head<3>().norm());
    longest_s = std::max(longest_s, needed_s);
  }
  RecordProperty("worst_mm", fmt::format("{:.2f}", 1e3 * worst_m));
  fmt::print("worst: {:.2f} mm, {:.3f} degrees after 10 s; registered after {:.1f} s\n", 1e3 * worst_m,
             worst_rad / k_degree, longest_s);
  EXPECT_LT(worst_m, 1e-3);
  EXPECT_LT(worst_rad, 0.1 * k_degree);
  EXPECT_LT(longest_s, 10);
}

TEST(GlassesCamera, StatesItsErrorWhileTheOdometryDrifts) {
  auto rng = test::test_rng();
  int within = 0, count = 0;
  double mean_square = 0, worst_m = 0;
  for (int round = 0; round < 40; ++round) {
    Wearer wearer(rng());
    GlassesRegistration registration = by_camera();
    wearer.play(110, &registration);
    for (int i = 0; i < 10; ++i) {
      wearer.play(wearer.headset.at_s() + 3, &registration);
      ASSERT_TRUE(registration.place()) << registration.advice();
      const Vector6d off = wearer.headset.error_of(*registration.place());
      const double squared = off.dot(wearer.headset.stated(*registration.place()).ldlt().solve(off));
      within += squared < 12.59;  // chi squared of 6 dimensions, 95 %
      mean_square += squared / 6;
      worst_m = std::max(worst_m, off.tail<3>().norm());
      ++count;
    }
  }
  fmt::print("within: {:.3f}, mean {:.2f}, worst {:.2f} mm\n", 1.0 * within / count, mean_square / count,
             1e3 * worst_m);
  EXPECT_GE(within, 0.90 * count) << mean_square / count;
  EXPECT_LE(within, 0.98 * count) << mean_square / count;
  EXPECT_LT(worst_m, 2.5e-3);
}

TEST(GlassesCamera, SaysWhatIsMissingAndIsGivenUpInTheEnd) {
  auto rng = test::test_rng();
  Wearer wearer(rng());
  GlassesRegistration registration = by_camera();
  wearer.looks = false;
  wearer.play(102, &registration);
  EXPECT_EQ(registration.state(), GlassesState::waiting);
  EXPECT_NE(registration.advice().find("Look at the prototype"), std::string::npos) << registration.advice();
  registration.set_view_problem("The markers in view are too small: go nearer.");
  wearer.play(103, &registration);
  EXPECT_EQ(registration.advice(), "The markers in view are too small: go nearer.");
  wearer.looks = true;
  wearer.play(112, &registration);
  ASSERT_TRUE(registration.place()) << registration.advice();
  wearer.headset.jump();
  wearer.play(118, &registration);
  ASSERT_TRUE(registration.place()) << registration.advice();
  EXPECT_LT(wearer.headset.error_of(*registration.place()).tail<3>().norm(), 2e-3);
  wearer.looks = false;
  wearer.play(900, &registration);
  EXPECT_FALSE(registration.place());
}

TEST(GlassesCamera, ViewsFromBeforeAJumpAndOfWrongNumbersAreLeftOut) {
  GlassesRegistration registration = by_camera();
  MeasuredView view;
  view.at_s = 5;
  registration.add_view(view);  // there is no odometry yet
  ASSERT_TRUE(registration.add_eye({1, 0, 0, 0}, {0, 1, 0}, 5.1, 100));
  registration.add_view(view);
  view.at_s = 5.1;
  view.camera_from_world.translation.x() = NAN;
  registration.add_view(view);
  view.camera_from_world.translation.x() = 0;
  view.at_s = 50;
  registration.add_view(view);
  EXPECT_EQ(registration.used() + registration.left_out(), 0);
  view.at_s = 5.1;
  registration.add_view(view);
  EXPECT_EQ(registration.used(), 1);
  registration.set_lost();
  ASSERT_TRUE(registration.add_eye({1, 0, 0, 0}, {0, 1, 0}, 6, 101));
  view.at_s = 5.5;
  registration.add_view(view);
  EXPECT_EQ(registration.used(), 1);
}

}  // namespace
}  // namespace limn::remote
