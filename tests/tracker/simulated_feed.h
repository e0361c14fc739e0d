#pragma once

#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "tests/support/random.h"
#include "tracker/feeds/foreign_tracker.h"

namespace limn::tracker {

/// Another system's feed of a body that a hand moves and turns, and the same body as our cameras see it.
struct SimulatedFeed {
  double delay_s = 0.06;    // from the moment of a pose to its arrival, at least
  double jitter_s = 0.003;  // mean of what is added to it
  double rate_hz = 60, camera_hz = 30;
  double drift = 1e-4;  // the feed's clock is fast by this share
  bool states_times = true;
  double turn_noise = 2e-3, shift_noise = 0.4e-3;          // the feed's, rad and m
  double own_turn_noise = 3e-3, own_shift_noise = 0.5e-3;  // our cameras'
  std::mt19937_64 rng;
  Pose world_from_feed, body_from_sensor;
  Eigen::Matrix<double, 6, 3> phase, hz;

  explicit SimulatedFeed(std::mt19937_64 seed) : rng(seed) {
    const auto vector = [&](double most) {
      return Eigen::Vector3d(test::uniform(rng, -most, most), test::uniform(rng, -most, most),
                             test::uniform(rng, -most, most));
    };
    world_from_feed = {exp_rotation(vector(1.7)), vector(2)};
    body_from_sensor = {exp_rotation(vector(1)), vector(0.06)};
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 3; ++k) {
        phase(i, k) = test::uniform(rng, 0, 6.28);
        hz(i, k) = test::uniform(rng, 0.15, 0.7);
      }
  }

  /// The body's true pose.
  Pose world_from_body(double at_s) const {
    Vector6d x;
    for (int i = 0; i < 6; ++i) {
      x[i] = 0;
      for (int k = 0; k < 3; ++k) x[i] += std::sin(6.283 * hz(i, k) * at_s + phase(i, k)) / 3;
    }
    return {exp_rotation(0.8 * x.head<3>()), Eigen::Vector3d(0.2 * x.tail<3>()) + Eigen::Vector3d(0, 0, 1)};
  }
  Pose feed_from_sensor(double at_s) const {
    return world_from_feed.inverse() * world_from_body(at_s) * body_from_sensor;
  }

  Pose noisy(const Pose& pose, double turn, double shift) {
    std::normal_distribution<double> normal;
    Vector6d delta = Vector6d::NullaryExpr([&](auto) { return normal(rng); });
    delta.head<3>() *= turn;
    delta.tail<3>() *= shift;
    return boxplus(pose, delta);
  }
  Fix own(double at_s) {
    Vector6d deviations;
    deviations << Eigen::Vector3d::Constant(own_turn_noise), Eigen::Vector3d::Constant(own_shift_noise);
    return {noisy(world_from_body(at_s), own_turn_noise, own_shift_noise),
            deviations.cwiseAbs2().asDiagonal(), shifted({}, at_s)};
  }

  /// The messages that arrive after the last call and until a moment, in the order of arrival.
  std::vector<ArrivedPose> arrived_until(double until_s) {
    for (; next_s_ < until_s; next_s_ += 1 / rate_hz) {
      ForeignPose pose{"wand", noisy(feed_from_sensor(next_s_), turn_noise, shift_noise)};
      if (states_times) pose.time_s = 5000 + (1 + drift) * next_s_;
      const double late_s = std::exponential_distribution<double>(1 / jitter_s)(rng);
      waiting_.push_back({pose, shifted({}, next_s_ + delay_s + late_s)});
    }
    std::vector<ArrivedPose> out;
    std::erase_if(waiting_, [&](const ArrivedPose& pose) {
      if (seconds_of(pose.arrived_at) > until_s) return false;
      out.push_back(pose);
      return true;
    });
    std::ranges::stable_sort(out, {}, &ArrivedPose::arrived_at);
    return out;
  }

  /// Runs to a moment: `sees` says whether the cameras see the body then; `change` may change the messages.
  template <class Sees, class Change>
  void run(double until_s, ForeignTracker* tracker, const Sees& sees, const Change& change) {
    for (; now_s < until_s; now_s += 1 / camera_hz) {
      std::vector<ArrivedPose> poses = arrived_until(now_s);
      change(now_s, &poses);
      tracker->receive(poses);
      if (sees(now_s)) tracker->add_own("wand", own(now_s));
      tracker->update();
    }
  }
  void run(double until_s, ForeignTracker* tracker) {
    run(
        until_s, tracker, [](double) { return true; }, [](double, std::vector<ArrivedPose>*) {});
  }

  double now_s = 0;

 private:
  double next_s_ = 0;
  std::vector<ArrivedPose> waiting_;
};

}  // namespace limn::tracker
