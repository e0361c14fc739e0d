#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/body_correspondences.h"
#include "tracker/motion.h"

namespace limn::tracker {

/// How bodies are expected to move. The defaults suit a hand.
struct MotionModel {
  /// White jerk of a moving body. Raise it for jerky motion; that costs jitter while the body moves. 3 suits
  /// a hand at 0.25 m/s (tests/tracker/motion_test).
  double jerk = 3;        ///< m²/s⁵
  double turn_jerk = 50;  ///< rad²/s⁵
  /// Random walk of a body that stands still. Raise it for stands that sway; that costs jitter.
  double drift = 0.05e-3;      ///< m per square root of a second
  double turn_drift = 0.9e-3;  ///< rad per square root of a second (0.05°)
  double starts_per_s = 0.5;   ///< how often a still body begins to move
  double stops_per_s = 1;      ///< how often a moving one comes to rest
  /// A body that is not seen is extrapolated for this long, then it is lost. Where images come more
  /// rarely it first stays at the extrapolated place, until one and a half times the interval between images
  /// has passed.
  double extrapolation_limit_s = 0.3;
};

MotionNoise still_noise(const MotionModel& model);
MotionNoise moving_noise(const MotionModel& model);

/// One hypothesis of a body's pose, of the two that a lone flat marker leaves open, or the up to four of
/// three balls. Whether the body moves is unknown too: both cases are filtered, with their probabilities (an
/// interacting multiple model: Blom and Bar-Shalom, "The interacting multiple model algorithm", 1988).
struct Branch {
  Motion still;  ///< may only drift
  Motion moving;
  double still_weight = 0.5;  ///< probability of `still`; `moving` has the rest
  double weight = 1;          ///< probability of this branch; those of all branches add up to 1
};

/// A body's pose from one moment's images alone, without history.
struct Fix {
  Pose world_from_body;
  Matrix6d covariance;
  Stamp captured_at;
};

/// The filter's state of one body, from all images up to a moment.
struct BodyFilter {
  std::string body;
  std::vector<Branch> branches;  ///< one to four, at the time measured_at; the first is the one to report
  std::vector<Fix> fixes;        ///< the newest one or two, oldest first, on the reported branch
  int marker_count = 0;
  double rms_px = 0;
  int misfits = 0;  ///< images in a row that contradict the motion
  int of_one = 0;   ///< images in a row with only one branch
  /// Images that must still agree before the body is reported: three balls in one camera lie like others by
  /// chance. 0 for markers.
  int images_to_confirm = 0;
  Stamp measured_at;  ///< capture time of the newest image that showed the body
  Stamp looked_at;    ///< capture time of the newest image
  /// Seconds between the newest three images, the older interval first. 0: not known yet.
  std::array<double, 2> gaps_s = {};
};

/// A body that is not seen for longer than this is lost: the model's limit, or one and a half times the
/// interval between images where these come more rarely. The shorter of the last two intervals counts, so
/// that a pause is not taken for a slow camera.
double lost_after_s(const BodyFilter& motion, const MotionModel& model);

/// What the images of one moment show of a body, by markers or by balls.
class BodyEvidence {
 public:
  virtual ~BodyEvidence() = default;
  /// The mode of the pose's posterior near `start`; nullopt: there is none. By default from points_at().
  virtual std::optional<PoseFit> posterior(const PosePrior& prior, const Pose& start) const;
  /// The points that the body's pose is computed from, as chosen for this pose.
  virtual ChosenCorners points_at(const Pose& world_from_body) const = 0;
  /// Squared normalised residuals of what else tells poses apart (the sizes of balls); 0 for markers.
  virtual double further_cost(const Pose& world_from_body) const = 0;
  /// The local minima of the points' error, likeliest first; none when the body is not seen. `predicted` and
  /// `wanted` as in body_correspondences.h.
  virtual std::vector<PoseFit> minima(std::span<const Pose> predicted, Minima wanted) const = 0;
};

/// The poses that a body's branches lead to at a moment, not before its newest image; none when it is lost
/// then.
std::vector<Pose> expected_poses(const BodyFilter& known, Stamp at, const MotionModel& model = {});

/// The filter's step for one body; `known` is null before the body was seen. See observed().
std::optional<BodyFilter> advanced(const BodyFilter* known,
                                   const std::string& body,
                                   const BodyEvidence& seen,
                                   Stamp captured_at,
                                   const MotionModel& model = {});

/// The filter's step: `known` (the result of the step before, empty at first), updated by the images of one
/// moment from all cameras that took one. The measurements are the corners themselves with their covariance,
/// so that a marker seen from straight ahead, whose four corners say little about its tilt, changes the tilt
/// little. Both branches are kept with their likelihoods. A body that is not seen keeps its motion. One that
/// is unseen for longer than the limit starts anew when it is seen again. Images older than `known` change
/// nothing. One image that contradicts the motion altogether (a false marker) is skipped; two in a row are
/// accepted.
std::vector<BodyFilter> observed(std::span<const BodyFilter> known,
                                 std::span<const Body> bodies,
                                 std::span<const View> views,
                                 Stamp captured_at,
                                 const MotionModel& model = {});

}  // namespace limn::tracker
