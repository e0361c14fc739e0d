#include "tracker/predict.h"

#include <algorithm>

namespace limn::tracker {
namespace {

struct Believed {
  Pose world_from_body;
  Matrix6d covariance;
};

// Typical motion of a hand (0.25 m/s at 0.5 Hz: 0.8 m/s²), which `hold` and `linear` ignore; it widens their
// covariance.
constexpr double k_hand_speed = 0.25, k_hand_turn = 1;                     // m/s, rad/s
constexpr double k_hand_acceleration = 0.8, k_hand_turn_acceleration = 3;  // m/s², rad/s²

Matrix6d left_out(double turn, double shift) {
  Vector6d deviations;
  deviations << Eigen::Vector3d::Constant(turn), Eigen::Vector3d::Constant(shift);
  return deviations.cwiseAbs2().asDiagonal();
}

Believed held(const Fix& fix, double seconds) {
  return {fix.world_from_body, fix.covariance + left_out(k_hand_turn * seconds, k_hand_speed * seconds)};
}

Believed continued(const Fix& first, const Fix& second, double seconds) {
  const double span = seconds_between(first.captured_at, second.captured_at);
  const double share = seconds / span;
  const double unforeseen = 0.5 * seconds * (seconds + span);
  return {interpolated(first.world_from_body, second.world_from_body, 1 + share),
          share * share * first.covariance + (1 + share) * (1 + share) * second.covariance +
              left_out(k_hand_turn_acceleration * unforeseen, k_hand_acceleration * unforeseen)};
}

Believed filtered(const Branch& branch, double seconds, const MotionModel& model) {
  const Motion motion =
      mixed(propagated(branch.still, seconds, still_noise(model)), branch.still_weight,
            propagated(branch.moving, seconds, moving_noise(model)), 1 - branch.still_weight);
  return {motion.world_from_body, motion.pose_covariance()};
}

Believed believed(const BodyFilter& known, double seconds, Prediction how, const MotionModel& model) {
  if (how == Prediction::filtered) return filtered(known.branches.front(), seconds, model);
  if (how == Prediction::linear && known.fixes.size() == 2)
    return continued(known.fixes[0], known.fixes[1], seconds);
  return held(known.fixes.back(), seconds);
}

}  // namespace

std::vector<Track> predicted(std::span<const BodyFilter> known,
                             Stamp at,
                             Prediction how,
                             const MotionModel& model,
                             std::optional<Stamp> decided_at) {
  std::vector<Track> tracks;
  for (const BodyFilter& motion : known) {
    if (motion.images_to_confirm > 0) continue;
    const double unseen = std::max(0.0, seconds_between(motion.measured_at, at));
    const Stamp decided = decided_at.value_or(at);
    const bool lost = seconds_between(motion.measured_at, decided) > lost_after_s(motion, model);
    const double carried = std::min(unseen, model.extrapolation_limit_s + seconds_between(decided, at));
    Believed now = believed(motion, lost ? 0 : carried, how, model);
    const double stayed = lost ? 0 : unseen - carried;
    now.covariance += left_out(k_hand_turn * stayed, k_hand_speed * stayed);
    Track track;
    track.body = motion.body;
    track.world_from_body = now.world_from_body;
    // Symmetric to the last bit, so that half of it can be sent (nodes/).
    track.covariance = now.covariance.selfadjointView<Eigen::Lower>();
    track.marker_count = motion.marker_count;
    track.rms_px = motion.rms_px;
    track.captured_at = motion.measured_at;
    track.at = std::max(at, motion.measured_at);
    track.tracking = lost                                     ? TrackingState::lost
                     : motion.looked_at == motion.measured_at ? TrackingState::measured
                                                              : TrackingState::extrapolated;
    tracks.push_back(std::move(track));
  }
  return tracks;
}

}  // namespace limn::tracker
