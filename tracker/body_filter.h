#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/body_correspondences.h"
#include "tracker/motion.h"

namespace limn::tracker {

/// How bodies are expected to move. The defaults are a hand's.
struct MotionModel {
  /// Raise it for jerky motion; costs jitter while moving. 3 suits reaches of 0.25 m/s
  /// (tests/tracker/motion_test).
  double jerk = 3;        ///< m²/s⁵
  double turn_jerk = 50;  ///< rad²/s⁵
  /// Of a body that stands still: what of its pose's change is believed. Raise it for stands that sway; costs
  /// jitter.
  double drift = 0.05e-3;      ///< m per square root of a second
  double turn_drift = 0.9e-3;  ///< rad per square root of a second (0.05°)
  double starts_per_s = 0.5;   ///< how often a still body begins to move
  double stops_per_s = 1;      ///< how often a moving one comes to rest
  /// For so long an unseen body is carried on; then it is lost. Where images come more rarely, it stays there
  /// until one and a half times between them have passed.
  double extrapolation_limit_s = 0.3;
};

MotionNoise still_noise(const MotionModel& model);
MotionNoise moving_noise(const MotionModel& model);

/// One belief of how a body stands, of the two that a lone flat marker leaves open. Whether it moves is open,
/// too: both answers are carried with their odds (an interacting multiple model: Blom and Bar-Shalom, "The
/// interacting multiple model algorithm", 1988).
struct Branch {
  Motion still;  ///< may only drift
  Motion moving;
  double still_weight = 0.5;  ///< moving: the rest
  double weight = 1;          ///< of this branch; all branches' add up to 1
};

/// An image's own pose of a body, without history.
struct Fix {
  Pose world_from_body;
  Matrix6d covariance;
  Stamp captured_at;
};

/// What is known of a body from the images up to a moment.
struct BodyFilter {
  std::string body;
  std::vector<Branch> branches;  ///< one or two, as of measured_at; the first is the one to report
  std::vector<Fix> fixes;        ///< the newest one or two, oldest first, on the reported branch
  int marker_count = 0;
  double rms_px = 0;
  int misfits = 0;    ///< images in a row that contradict the motion
  int of_one = 0;     ///< images with one branch alone
  Stamp measured_at;  ///< of the newest image that showed the body
  Stamp looked_at;    ///< of the newest image
  /// Between the newest three images, the older first; 0: not known yet.
  std::array<double, 2> gaps_s = {};
};

/// A body unseen for longer is lost: the model's limit, or one and a half times between images where these
/// come more rarely. Of the last two the shorter: a pause is no rate.
double lost_after_s(const BodyFilter& motion, const MotionModel& model);

/// What is known after one more moment's images (of all cameras that took one): the step of the filter. The
/// corners themselves are its measurement, with their covariance, so that a marker seen from straight ahead,
/// whose four corners know little of its tilt, moves its tilt little. `known` is what the step before
/// returned (at first nothing). Both branches live on with their likelihoods; a body that is not seen keeps
/// its motion; one unseen for longer than the limit starts afresh when seen again. Images older than what
/// is known change nothing. An image that contradicts the motion altogether (a false marker) is passed over;
/// two in a row are believed.
std::vector<BodyFilter> observed(std::span<const BodyFilter> known,
                                 std::span<const Body> bodies,
                                 std::span<const View> views,
                                 Stamp captured_at,
                                 const MotionModel& model = {});

}  // namespace limn::tracker
