#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "tracker/body_filter.h"
#include "tracker/hand_eye.h"

namespace limn::tracker {

/// The noise of a feed's poses, standard deviations of one coordinate.
struct FeedNoise {
  double turn = 0.2 * 0.017453292519943295;  ///< rad; assumed where the feed states none
  double shift = 1e-3;                       ///< m
  bool is_stated = false;                    ///< Smaller noise than stated is not believed.

  Matrix6d covariance() const;
};

/// A pose as a feed states it, at a moment of our clock before its delay is known.
struct FeedSample {
  Stamp at;
  Pose feed_from_sensor;
};

/// How a feed's poses of one sensor relate to a body in the room.
struct Registration {
  HandEye hand_eye;
  Delay delay;      ///< FeedSample::at is so much later than the moment that the pose shows
  FeedNoise noise;  ///< as the pairs' residuals show it
  int pairs = 0;

  /// The body's pose by a sensor's pose. With `covariance`: what follows from the errors of the registration.
  Pose world_from_body(const Pose& feed_from_sensor, Matrix6d* covariance = nullptr) const;
};

/// Measures the delay of a feed against our cameras and registers it to the room, from poses of one body that
/// both have seen. It keeps a bounded number of pairs that differ much from each other, prefers slow ones,
/// and solves anew as motion brings more.
class FeedRegistration {
 public:
  void add_sample(const FeedSample& sample, const FeedNoise& noise);
  /// The pose of the body by our cameras alone.
  void add_own(const Fix& own);
  /// Pairs what has come, and solves where that is due.
  void update();

  const std::optional<Registration>& registration() const { return registration_; }
  /// What people should do until there is a registration.
  const std::string& advice() const { return advice_; }
  /// Whether the newest registration was given up, because our cameras contradicted it for a second.
  bool disagrees() const { return disagrees_; }
  /// How far the newest pairs were from the registration that was given up, mm.
  double off_mm() const { return off_mm_; }

 private:
  // Both systems' poses of one moment. The sensor's pose is that for `delay_s`; its velocity (rad/s, m/s, the
  // feed's axes) gives it for others.
  struct Pair {
    Fix own;
    Pose feed_from_sensor;
    Vector6d velocity = Vector6d::Zero();
    double delay_s = 0;
    double averaged = 1;  // share of the variance that interpolation leaves
  };
  std::optional<Pair> pair_of(const Fix& own) const;
  void keep(const Pair& pair);
  void check(const Pair& pair);
  void find_delay();
  void solve();
  std::vector<PosePair> pose_pairs(double delay_s, const FeedNoise& noise) const;
  double refined_delay(const std::vector<PosePair>& pairs, const HandEye& solution, double* stddev_s) const;
  FeedNoise measured_noise(const std::vector<PosePair>& pairs, const HandEye& solution) const;
  void restart();

  FeedNoise noise_;
  std::deque<FeedSample> samples_;
  std::deque<Fix> own_;       // all of the last seconds, for the delay
  std::size_t unpaired_ = 0;  // the newest of them, not paired yet
  std::vector<Pair> pairs_;
  std::optional<Delay> delay_;
  std::optional<Registration> registration_;
  std::string advice_ = "move and turn it in view of the cameras";
  int fresh_pairs_ = 0;  // since the last solution
  std::optional<Stamp> tried_at_;
  int contradictions_ = 0;
  bool disagrees_ = false;
  double off_mm_ = 0;
};

}  // namespace limn::tracker
