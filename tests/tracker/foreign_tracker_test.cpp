#include "tracker/feeds/foreign_tracker.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <limits>

#include "tests/support/matchers.h"
#include "tests/tracker/simulated_feed.h"
#include "tracker/predict.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using Poses = std::vector<ArrivedPose>;

const FeedSetup k_wand{"lab", {{"wand", "wand", std::nullopt}}, std::nullopt};

SimulatedFeed simulated() { return SimulatedFeed(test::test_rng()); }

FeedStatus status(const ForeignTracker& tracker, const SimulatedFeed& feed) {
  return tracker.statuses(shifted({}, feed.now_s)).front();
}

// The body's track by the feed alone; nullopt: it gives none.
std::optional<Track> track(const ForeignTracker& tracker, double at_s) {
  const auto tracks = predicted(tracker.motions(shifted({}, at_s)), shifted({}, at_s));
  return tracks.empty() ? std::nullopt : std::optional(tracks.front());
}

TEST(FeedRegistrationTest, DerivativesAreTheFiniteDifferences) {
  SimulatedFeed feed = simulated();
  Registration at;
  at.hand_eye.world_from_feed = feed.world_from_feed;
  at.hand_eye.body_from_sensor = feed.body_from_sensor;
  const Pose sensor = feed.feed_from_sensor(1);
  EXPECT_TRUE(test::pose_near(at.world_from_body(sensor), feed.world_from_body(1), 1e-6_deg, 1e-9));
  for (int i = 0; i < 12; ++i) {
    Eigen::Matrix<double, 12, 1> delta = Eigen::Matrix<double, 12, 1>::Zero();
    delta[i] = 1e-6;
    Registration moved = at;
    moved.hand_eye.world_from_feed = boxplus(feed.world_from_feed, delta.head<6>());
    moved.hand_eye.body_from_sensor = boxplus(feed.body_from_sensor, delta.tail<6>());
    const Vector6d change = boxminus(moved.world_from_body(sensor), at.world_from_body(sensor)) / 1e-6;
    at.hand_eye.covariance.setZero();
    at.hand_eye.covariance(i, i) = 1;
    Matrix6d covariance;
    static_cast<void>(at.world_from_body(sensor, &covariance));
    EXPECT_LT((covariance - change * change.transpose()).cwiseAbs().maxCoeff(), 1e-4) << i;
  }
}

// Delay 60 ms and more, a clock that drifts, an unknown mounting: the registration's errors are as stated.
void expect_true_statements(bool states_times, double rate_hz) {
  auto rng = test::test_rng();
  constexpr int k_rounds = 60;
  int within = 0, delay_within = 0;
  double worst_mm = 0, squares = 0, worst_delay = 0;
  for (int round = 0; round < k_rounds; ++round) {
    SimulatedFeed feed(rng);
    rng.discard(1000);
    feed.states_times = states_times;
    feed.rate_hz = rate_hz;
    FeedRegistration registration;
    FeedClock clock;
    for (double at_s = 0; at_s < 8; at_s += 1 / feed.camera_hz) {
      for (const ArrivedPose& arrived : feed.arrived_until(at_s))
        registration.add_sample(
            {clock.moment_of(arrived.pose.time_s, arrived.arrived_at), arrived.pose.feed_from_sensor}, {});
      registration.add_own(feed.own(at_s));
      registration.update();
    }
    const auto& found = registration.registration();
    ASSERT_TRUE(found) << round << ": " << registration.advice();
    Matrix6d covariance;
    const Pose stated = found->world_from_body(feed.feed_from_sensor(8), &covariance);
    const Vector6d off = boxminus(stated, feed.world_from_body(8));
    for (int i = 0; i < 6; ++i) within += std::abs(off[i]) < 1.96 * std::sqrt(covariance(i, i));
    squares += off.dot(covariance.ldlt().solve(off)) / 6 / k_rounds;
    worst_mm = std::max(worst_mm, 1e3 * off.tail<3>().norm());
    const double true_delay_s = feed.delay_s + (states_times ? 0 : feed.jitter_s);
    const double delay_off_s = std::abs(found->delay.seconds - true_delay_s);
    worst_delay = std::max(worst_delay, delay_off_s);
    delay_within += delay_off_s < 1.96 * found->delay.stddev_s + 0.2e-3;
  }
  const double share = within / (6.0 * k_rounds);
  testing::Test::RecordProperty("within", std::to_string(share));
  std::printf("within 1.96 deviations: %.3f; chi² %.2f; worst %.2f mm, %.2f ms; delays within %d of %d\n",
              share, squares, worst_mm, 1e3 * worst_delay, delay_within, k_rounds);
  EXPECT_GE(share, 0.90) << "errors within 1.96 standard deviations; mean square " << squares;
  EXPECT_LE(share, 0.98) << squares;
  EXPECT_LT(worst_mm, 3);
  EXPECT_LT(worst_delay, 4e-3);
  EXPECT_GE(delay_within, 0.85 * k_rounds);
}

TEST(FeedRegistrationTest, StatesItsErrors) { expect_true_statements(true, 60); }
TEST(FeedRegistrationTest, StatesItsErrorsWithoutTimes) { expect_true_statements(false, 60); }
TEST(FeedRegistrationTest, StatesItsErrorsAtFilmRate) { expect_true_statements(true, 24); }

TEST(ForeignTrackerTest, GivesTheBodyWhereTheCamerasDoNotSeeIt) {
  double squares = 0, worst_mm = 0;
  int count = 0;
  for (int seed = 0; seed < 10; ++seed) {
    auto rng = test::test_rng();
    rng.discard(static_cast<unsigned long long>(seed) * 977);
    SimulatedFeed feed(rng);
    ForeignTracker tracker(k_wand);
    feed.run(8, &tracker);
    ASSERT_EQ(status(tracker, feed).state, FeedState::registered) << status(tracker, feed).advice;
    for (double until_s = 8.1; until_s < 12; until_s += 0.1) {
      feed.run(
          until_s, &tracker, [](double) { return false; }, [](double, Poses*) {});
      const auto found = track(tracker, feed.now_s - 1 / feed.camera_hz);
      ASSERT_TRUE(found && found->tracking == TrackingState::measured);
      const Vector6d off = boxminus(found->world_from_body, feed.world_from_body(seconds_of(found->at)));
      squares += off.dot(found->covariance.ldlt().solve(off)) / 6;
      worst_mm = std::max(worst_mm, 1e3 * off.tail<3>().norm());
      ++count;
    }
  }
  // The hand of the simulation is as quick as the motion model's, which is extrapolated by 60 to 110 ms here.
  EXPECT_LT(squares / count, 1.6);
  EXPECT_GT(squares / count, 0.3);
  EXPECT_LT(worst_mm, 15);
}

TEST(ForeignTrackerTest, SaysWhatToDo) {
  SimulatedFeed feed = simulated();
  ForeignTracker tracker(k_wand);
  EXPECT_EQ(status(tracker, feed).state, FeedState::waiting);
  feed.run(0.5, &tracker);
  EXPECT_EQ(status(tracker, feed).state, FeedState::collecting);
  EXPECT_NE(status(tracker, feed).advice.find("turn it"), std::string::npos) << status(tracker, feed).advice;
  EXPECT_FALSE(track(tracker, feed.now_s));
  feed.run(9, &tracker);
  const FeedStatus at = status(tracker, feed);
  EXPECT_EQ(at.state, FeedState::registered);
  ASSERT_TRUE(at.delay);
  EXPECT_NEAR(at.delay->seconds, 0.06, 0.004);
  EXPECT_LT(at.stddev_mm, 1.5);
  const auto notes = tracker.take_notes(shifted({}, feed.now_s));
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(notes[0].find("registered to the room within"), std::string::npos) << notes[0];
  EXPECT_TRUE(tracker.take_notes(shifted({}, feed.now_s)).empty());
}

TEST(ForeignTrackerTest, SilenceIsALossAndIsNeverGuessed) {
  SimulatedFeed feed = simulated();
  ForeignTracker tracker(k_wand);
  feed.run(8, &tracker);
  const auto mute = [](double, Poses* poses) { poses->clear(); };
  feed.run(
      8.5, &tracker, [](double) { return false; }, mute);
  EXPECT_EQ(status(tracker, feed).state, FeedState::lost);
  const auto gone = track(tracker, feed.now_s);
  EXPECT_TRUE(gone && gone->tracking == TrackingState::lost);
  feed.run(
      9, &tracker, [](double) { return false; }, [](double, Poses*) {});
  EXPECT_EQ(status(tracker, feed).state, FeedState::registered);
  // The system itself says that it does not see the sensor.
  feed.run(
      9.1, &tracker, [](double) { return false; },
      [](double, Poses* poses) {
        for (ArrivedPose& pose : *poses) pose.pose.is_lost = true;
      });
  EXPECT_EQ(status(tracker, feed).state, FeedState::lost);
}

// Its clock stands still, runs twice as fast, jumps to and fro, or counts backwards.
TEST(ForeignTrackerTest, LiesAboutTimeAreNoticedAndDoNoHarm) {
  const std::vector<std::function<double(double, int)>> lies = {
      [](double, int) { return 17.0; }, [](double at_s, int) { return 2 * at_s; },
      [](double at_s, int i) { return at_s + (i / 30 % 2) * 100; }, [](double at_s, int) { return -at_s; },
      [](double at_s, int) { return 1e11 * at_s; }};
  for (std::size_t kind = 0; kind < lies.size(); ++kind) {
    SimulatedFeed feed = simulated();
    ForeignTracker tracker(k_wand);
    int count = 0;
    std::string notes;
    const auto lie = [&](double now_s, Poses* poses) {
      for (ArrivedPose& pose : *poses) pose.pose.time_s = lies[kind]((*pose.pose.time_s - 5000), count++);
      for (const std::string& note : tracker.take_notes(shifted({}, now_s))) notes += note + "\n";
    };
    feed.run(
        14, &tracker, [](double) { return true; }, lie);
    EXPECT_EQ(status(tracker, feed).state, FeedState::registered) << kind << status(tracker, feed).advice;
    EXPECT_NE(notes.find("its times are not used any more"), std::string::npos) << kind << notes;
    const auto found = track(tracker, feed.now_s - 1 / feed.camera_hz);
    ASSERT_TRUE(found) << kind;
    EXPECT_TRUE(
        test::pose_near(found->world_from_body, feed.world_from_body(seconds_of(found->at)), 4_deg, 15_mm))
        << kind;
  }
}

TEST(ForeignTrackerTest, PosesThatAreNotFiniteAreLeftOut) {
  SimulatedFeed feed = simulated();
  ForeignTracker tracker(k_wand);
  const auto damage = [](double, Poses* poses) {
    if (poses->empty()) return;
    Poses more = *poses;
    more[0].pose.feed_from_sensor.translation.x() = std::numeric_limits<double>::quiet_NaN();
    more[0].pose.feed_from_sensor.rotation.w() = std::numeric_limits<double>::infinity();
    poses->insert(poses->begin(), more[0]);
  };
  feed.run(
      8, &tracker, [](double) { return true; }, damage);
  EXPECT_EQ(status(tracker, feed).state, FeedState::registered);
  const auto notes = tracker.take_notes(shifted({}, feed.now_s));
  EXPECT_NE(notes.back().find("not finite"), std::string::npos);
  EXPECT_TRUE(track(tracker, feed.now_s)->world_from_body.is_finite());
}

TEST(ForeignTrackerTest, AFloodIsBounded) {
  SimulatedFeed feed = simulated();
  ForeignTracker tracker(k_wand);
  feed.run(8, &tracker);
  Poses flood;
  for (int i = 0; i < 200000; ++i)
    flood.push_back({{"wand", feed.feed_from_sensor(feed.now_s)}, shifted({}, feed.now_s + 1e-7 * i)});
  const auto begun = std::clock();
  tracker.receive(flood);
  tracker.update();
  EXPECT_LT(static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC, 0.5);
  EXPECT_TRUE(track(tracker, feed.now_s)->world_from_body.is_finite());
}

// The other system's origin is moved: our cameras contradict it, and it is registered anew.
TEST(ForeignTrackerTest, AMovedOriginIsNoticed) {
  SimulatedFeed feed = simulated();
  ForeignTracker tracker(k_wand);
  feed.run(8, &tracker);
  ASSERT_EQ(status(tracker, feed).state, FeedState::registered);
  feed.world_from_feed = feed.world_from_feed * Pose(exp_rotation({0, 0, 0.1}), {0.05, 0, 0});
  feed.run(9.6, &tracker);
  EXPECT_EQ(status(tracker, feed).state, FeedState::disagrees) << status(tracker, feed).advice;
  EXPECT_FALSE(track(tracker, feed.now_s)) << "it must not be used meanwhile";
  feed.run(20, &tracker);
  EXPECT_EQ(status(tracker, feed).state, FeedState::registered) << status(tracker, feed).advice;
}

// A wrong handedness cannot be registered, and the advice names it.
TEST(ForeignTrackerTest, AMirroredFrameIsRefused) {
  SimulatedFeed feed = simulated();
  ForeignTracker tracker(k_wand);
  const auto mirror = [](double, Poses* poses) {
    for (ArrivedPose& pose : *poses) {
      Pose& p = pose.pose.feed_from_sensor;
      const Eigen::Quaterniond q = p.rotation;
      p = Pose(Eigen::Quaterniond(q.w(), -q.x(), -q.y(), q.z()),
               Eigen::Vector3d(p.translation.x(), p.translation.y(), -p.translation.z()));
      p.rotation = q;  // positions are mirrored, rotations are not
    }
  };
  feed.run(
      10, &tracker, [](double) { return true; }, mirror);
  EXPECT_EQ(status(tracker, feed).state, FeedState::collecting);
  EXPECT_NE(status(tracker, feed).advice.find("left_handed"), std::string::npos)
      << status(tracker, feed).advice;
}

// A second body that our cameras never see, registered by the first, and one with a frame from the file.
TEST(ForeignTrackerTest, AnotherBodyRegistersTheFrame) {
  SimulatedFeed feed = simulated();
  FeedSetup setup = k_wand;
  const Pose mounted(exp_rotation({0.1, 0.2, 0.3}), {0.01, 0.02, 0.03});
  setup.bodies.push_back({"hat", "hat", mounted});
  ForeignTracker tracker(setup);
  const Pose feed_from_hat(exp_rotation({0.3, 0, 1}), {0.5, 0.1, 0.2});
  feed.run(
      8, &tracker, [](double) { return true; },
      [&](double, Poses* poses) {
        const Poses wand = *poses;
        for (ArrivedPose hat : wand) {
          hat.pose.sensor = "hat";
          hat.pose.feed_from_sensor = feed_from_hat;
          poses->push_back(hat);
        }
      });
  const auto tracks = predicted(tracker.motions(shifted({}, feed.now_s)), shifted({}, feed.now_s));
  ASSERT_EQ(tracks.size(), 2U);
  EXPECT_EQ(tracks[1].body, "hat");
  const Pose truth = feed.world_from_feed * feed_from_hat * mounted.inverse();
  EXPECT_TRUE(test::pose_near(tracks[1].world_from_body, truth, 1_deg, 15_mm));
  const Vector6d off = boxminus(tracks[1].world_from_body, truth);
  EXPECT_LT(off.dot(tracks[1].covariance.ldlt().solve(off)), 22);  // chi² of 6: 0.1 %

  FeedSetup fixed{"lab", {{"hat", "hat", std::nullopt}}, feed.world_from_feed};
  ForeignTracker alone(fixed);
  alone.receive(Poses{{{"hat", feed_from_hat}, shifted({}, 1)}});
  const auto found = track(alone, 1);
  ASSERT_TRUE(found);
  EXPECT_TRUE(test::pose_near(found->world_from_body, feed.world_from_feed * feed_from_hat, 1e-6_deg, 1e-9));
}

// Cameras and feed together are better than each alone, and the feed decides between planar branches.
TEST(ForeignTrackerTest, CamerasAndFeedAreCombinedByTheirCovariance) {
  const Stamp at = shifted({}, 1);
  const auto filter = [&](const Pose& pose, double turn, double shift) {
    BodyFilter out;
    out.body = "wand";
    Branch branch;
    Vector6d deviations;
    deviations << Eigen::Vector3d::Constant(turn), Eigen::Vector3d::Constant(shift);
    branch.still.world_from_body = branch.moving.world_from_body = pose;
    branch.still.covariance.topLeftCorner<6, 6>() = deviations.cwiseAbs2().asDiagonal();
    branch.moving.covariance = Matrix18d::Identity() * 0.01;
    branch.moving.covariance.topLeftCorner<6, 6>() = branch.still.covariance.topLeftCorner<6, 6>();
    out.branches = {branch};
    out.fixes = {{pose, branch.still.pose_covariance(), at}};
    out.measured_at = out.looked_at = at;
    return out;
  };
  BodyFilter camera = filter({Eigen::Quaterniond::Identity(), {0, 0, 1}}, 0.02, 1e-3);
  const BodyFilter feed = filter({Eigen::Quaterniond::Identity(), {0, 0, 1.002}}, 0.01, 1e-3);
  const auto both = predicted(std::vector{combined(&camera, feed)}, at);
  EXPECT_NEAR(both[0].world_from_body.translation.z(), 1.001, 1e-6);
  EXPECT_NEAR(both[0].covariance(5, 5), 0.5e-6, 1e-9);
  EXPECT_EQ(both[0].tracking, TrackingState::measured);
  EXPECT_NEAR(predicted(std::vector{combined(nullptr, feed)}, at)[0].world_from_body.translation.z(), 1.002,
              1e-9);
  // The other branch, turned by 40 degrees, is the one that the feed states.
  camera.branches.push_back(camera.branches[0]);
  camera.branches[0].still.world_from_body.rotation = exp_rotation({0.7, 0, 0});
  camera.branches[0].moving.world_from_body.rotation = exp_rotation({0.7, 0, 0});
  camera.branches[0].weight = 0.8;
  camera.branches[1].weight = 0.2;
  const auto decided = predicted(std::vector{combined(&camera, feed)}, at);
  EXPECT_LT(angle_between(decided[0].world_from_body.rotation, Eigen::Quaterniond::Identity()), 0.01);
}

}  // namespace
}  // namespace limn::tracker
