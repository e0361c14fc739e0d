#include "tracker/body_filter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace limn::tracker {
namespace {

// The branch that is not reported keeps at least this weight, so that evidence can bring it back. Persistent
// corner errors (a bent sheet, a lens model that does not fit) make the filter surer of the reported branch
// than it should be.
constexpr double k_least_weight = 1e-6;
// The reported branch changes only when the other one is this likely, so that it does not flicker when both
// are about equally likely.
constexpr double k_change_at = 0.9;
// One image changes the log odds between the branches by at most this. Corner errors of one image are
// correlated (a patch of light, a covered side, a small marker's pattern), so large ones are more frequent
// than the model says. One image must not outweigh all earlier ones.
constexpr double k_most_evidence = 2;
// Branches nearer than this (rad) are the same. Beyond it, the planar ambiguity has two separate minima.
constexpr double k_same_branch = 0.02;
// Largest excess of chi² by which an image may miss the motion. Noise in the prior's six degrees of freedom
// exceeds it with a probability of 1e-10.
constexpr double k_max_excess = 60;
constexpr int k_misfits_believed = 2;
// A pose that the filter has lost as a branch, and that the sizes of balls suit better by this much, becomes
// a branch again, of this weight relative to the reported one.
constexpr double k_better_by = 6, k_returned_weight = 0.05;
// While there is one branch, a second is searched for once in this many images.
constexpr int k_second_every = 3;
// Standard deviations of velocity and acceleration of a body that has just come into view (k_seen), and of
// one that was still and starts to move (k_start).
constexpr double k_seen_turn = 2, k_seen_speed = 0.5;                     // rad/s, m/s
constexpr double k_seen_turn_acceleration = 15, k_seen_acceleration = 3;  // rad/s², m/s²
constexpr double k_start_turn = 0.5, k_start_speed = 0.1;
constexpr double k_start_turn_acceleration = 10, k_start_acceleration = 2;

class MarkerEvidence : public BodyEvidence {
 public:
  explicit MarkerEvidence(BodyCorrespondences seen) : seen_(std::move(seen)) {}
  ChosenCorners points_at(const Pose& world_from_body) const override {
    return corners_at(seen_, world_from_body);
  }
  double further_cost(const Pose&) const override { return 0; }
  std::vector<PoseFit> minima(std::span<const Pose> predicted, Minima wanted) const override {
    return tracker::minima(seen_, predicted, wanted);
  }

 private:
  BodyCorrespondences seen_;
};

struct Rates {
  double turn, speed, turn_acceleration, acceleration;
};
constexpr Rates k_seen = {k_seen_turn, k_seen_speed, k_seen_turn_acceleration, k_seen_acceleration};
constexpr Rates k_start = {k_start_turn, k_start_speed, k_start_turn_acceleration, k_start_acceleration};

Motion at_rest(const Pose& world_from_body, const Matrix6d& covariance) {
  Motion motion;
  motion.world_from_body = world_from_body;
  motion.covariance.topLeftCorner<6, 6>() = covariance;
  return motion;
}

// The same pose, with velocity and acceleration of zero mean and these standard deviations.
Motion roused(const Motion& still, const Rates& rates) {
  Motion motion = at_rest(still.world_from_body, still.pose_covariance());
  Eigen::Matrix<double, 12, 1> deviations;
  deviations << Eigen::Vector3d::Constant(rates.turn), Eigen::Vector3d::Constant(rates.speed),
      Eigen::Vector3d::Constant(rates.turn_acceleration), Eigen::Vector3d::Constant(rates.acceleration);
  motion.covariance.bottomRightCorner<12, 12>() = deviations.cwiseAbs2().asDiagonal();
  return motion;
}

Motion halted(const Motion& moving) { return at_rest(moving.world_from_body, moving.pose_covariance()); }

Branch started(const PoseFit& fit) {
  const Motion still = at_rest(fit.world_from_body, fit.covariance);
  return {still, roused(still, k_seen), 0.5, 1};
}

std::optional<PoseFit> posterior(const BodyEvidence& seen, const Motion& prior, const Pose& start) {
  return seen.posterior(prior_of(prior), start);
}

// A branch, predicted to the time of the new images.
struct Forecast {
  Motion still, moving;
  double still_share;  // probability that it is still
  double weight;       // weight of the branch
};

Forecast forecast(const Branch& branch, double seconds, const MotionModel& model) {
  const double stays_still = branch.still_weight * std::exp(-model.starts_per_s * seconds);
  const double starts = branch.still_weight - stays_still;
  const double stays_moving = (1 - branch.still_weight) * std::exp(-model.stops_per_s * seconds);
  const double stops = 1 - branch.still_weight - stays_moving;
  const double still = stays_still + stops, moving = starts + stays_moving;
  return {
      propagated(mixed(branch.still, stays_still / still, halted(branch.moving), stops / still), seconds,
                 still_noise(model)),
      propagated(mixed(roused(branch.still, k_start), starts / moving, branch.moving, stays_moving / moving),
                 seconds, moving_noise(model)),
      still, branch.weight};
}

struct Update {
  Branch branch;
  double log_weight;  // the branch's, not normalised
  PoseFit moving;     // posterior for a moving body
};

// nullopt when no pose near the forecast suits the corners.
std::optional<Update> updated(const Forecast& at, const BodyEvidence& seen) {
  const auto still = posterior(seen, at.still, at.still.world_from_body);
  const auto moving = posterior(seen, at.moving, at.moving.world_from_body);
  if (!moving) return std::nullopt;
  const double log_moving = std::log(1 - at.still_share) + log_evidence(at.moving, *moving);
  const double log_still =
      still ? std::log(at.still_share) + log_evidence(at.still, *still) : log_moving - 100;
  const double highest = std::max(log_moving, log_still);
  const double sum = std::exp(log_moving - highest) + std::exp(log_still - highest);
  Branch branch;
  branch.moving = corrected(at.moving, *moving);
  branch.still = still ? corrected(at.still, *still) : halted(branch.moving);
  branch.still_weight = std::clamp(std::exp(log_still - highest) / sum, 1e-9, 1 - 1e-9);
  const double further = 0.5 * seen.further_cost(moving->world_from_body);
  return Update{branch, std::log(at.weight) + highest + std::log(sum) - further, *moving};
}

// A further mode of the posterior, when it has one near another minimum of the points' own error. This
// restores a branch after a view in which two branches are the same (for a marker, a frontal one).
std::optional<Update> further_mode(const Forecast& at,
                                   std::span<const Update> known,
                                   const BodyEvidence& seen,
                                   std::span<const PoseFit> fits) {
  for (const PoseFit& fit : fits) {
    const auto mode = posterior(seen, at.moving, fit.world_from_body);
    if (!mode || std::ranges::any_of(known, [&](const Update& other) {
          return angle_between(mode->world_from_body.rotation, other.moving.world_from_body.rotation) <
                 k_same_branch;
        }))
      continue;
    const double log_weight = std::log(at.weight * (1 - at.still_share)) + log_evidence(at.moving, *mode) -
                              0.5 * seen.further_cost(mode->world_from_body);
    return Update{started(fit), log_weight, *mode};
  }
  return std::nullopt;
}

bool are_one(const Update& a, const Update& b) {
  return angle_between(a.branch.moving.world_from_body.rotation, b.branch.moving.world_from_body.rotation) <
         k_same_branch;
}

// Normalises the weights to a sum of 1. The reported branch stays first until another one is much likelier.
std::vector<Branch> weighed(const std::vector<Update>& updates) {
  double highest = updates.front().log_weight;
  for (const Update& update : updates) highest = std::max(highest, update.log_weight);
  std::vector<Branch> branches;
  double sum = 0;
  for (const Update& update : updates) {
    branches.push_back(update.branch);
    sum += branches.back().weight = std::max(k_least_weight, std::exp(update.log_weight - highest));
  }
  for (Branch& branch : branches) branch.weight /= sum;
  for (std::size_t i = 1; i < branches.size(); ++i)
    if (branches[i].weight > k_change_at) std::swap(branches[0], branches[i]);
  return branches;
}

const PoseFit& nearest_fit(std::span<const PoseFit> fits, const Pose& world_from_body) {
  return *std::min_element(fits.begin(), fits.end(), [&](const PoseFit& a, const PoseFit& b) {
    return angle_between(a.world_from_body.rotation, world_from_body.rotation) <
           angle_between(b.world_from_body.rotation, world_from_body.rotation);
  });
}

void note_measured(const BodyEvidence& seen,
                   std::span<const PoseFit> fits,
                   Stamp captured_at,
                   BodyFilter* motion) {
  const PoseFit& fit = nearest_fit(fits, motion->branches.front().moving.world_from_body);
  motion->fixes.push_back({fit.world_from_body, fit.covariance, captured_at});
  if (motion->fixes.size() > 2) motion->fixes.erase(motion->fixes.begin());
  motion->marker_count = seen.points_at(fit.world_from_body).marker_count;
  motion->rms_px = fit.rms_px;
  motion->misfits = 0;
  motion->measured_at = motion->looked_at = captured_at;
}

// With a flat prior: Laplace's approximation of the likelihood's integral over each minimum.
double log_weight_alone(const PoseFit& fit) {
  return 0.5 * (std::log(fit.covariance.determinant()) - fit.chi_square);
}

BodyFilter started(const std::string& body,
                   const BodyEvidence& seen,
                   std::span<const PoseFit> fits,
                   Stamp captured_at) {
  BodyFilter motion;
  motion.body = body;
  std::vector<Update> updates;
  for (const PoseFit& fit : fits) updates.push_back({started(fit), log_weight_alone(fit), fit});
  const auto likeliest = std::ranges::max_element(updates, {}, &Update::log_weight);
  std::iter_swap(updates.begin(), likeliest);
  motion.branches = weighed(updates);
  note_measured(seen, fits, captured_at, &motion);
  return motion;
}

// A minimum that is no branch although what else is seen suits it better: the prior of a wrong branch can be
// so narrow that it leaves no mode there.
std::optional<Update> returned(std::span<const Update> updates,
                               const BodyEvidence& seen,
                               std::span<const PoseFit> fits) {
  const double now = seen.further_cost(updates.front().moving.world_from_body);
  for (const PoseFit& fit : fits) {
    const Update update{started(fit), updates.front().log_weight + std::log(k_returned_weight), fit};
    if (now > seen.further_cost(fit.world_from_body) + k_better_by &&
        std::ranges::none_of(updates, [&](const Update& other) { return are_one(update, other); }))
      return update;
  }
  return std::nullopt;
}

// nullopt when the image contradicts the motion.
std::optional<std::vector<Branch>> advanced_branches(const BodyFilter& known,
                                                     const BodyEvidence& seen,
                                                     std::span<const PoseFit> fits,
                                                     double seconds,
                                                     const MotionModel& model) {
  std::vector<Update> updates;
  std::vector<Forecast> forecasts;
  for (const Branch& branch : known.branches) {
    const Forecast at = forecast(branch, seconds, model);
    auto update = updated(at, seen);
    if (!update || std::ranges::any_of(updates, [&](const Update& other) { return are_one(*update, other); }))
      continue;
    updates.push_back(std::move(*update));
    forecasts.push_back(at);
  }
  for (std::size_t i = 1; i < updates.size(); ++i) {
    const double before = std::log(forecasts[i].weight / forecasts[0].weight);
    const double evidence = updates[i].log_weight - updates[0].log_weight - before;
    updates[i].log_weight =
        updates[0].log_weight + before + std::clamp(evidence, -k_most_evidence, k_most_evidence);
  }
  const bool suits = std::any_of(updates.begin(), updates.end(), [&](const Update& update) {
    return update.moving.chi_square < fits.front().chi_square + k_max_excess;
  });
  if (!suits) return std::nullopt;
  while (updates.size() < fits.size()) {
    auto further = further_mode(forecasts[0], updates, seen, fits);
    if (!further) break;
    updates.push_back(std::move(*further));
  }
  if (auto better = returned(updates, seen, fits)) updates.push_back(std::move(*better));
  return weighed(updates);
}

BodyFilter seen_again(const BodyFilter& known,
                      const BodyEvidence& seen,
                      Stamp captured_at,
                      const MotionModel& model) {
  BodyFilter after = known;
  after.looked_at = captured_at;
  const double unseen = seconds_between(known.measured_at, captured_at);
  const bool was_lost = unseen > lost_after_s(known, model);
  const std::vector<Pose> predictions = expected_poses(known, captured_at, model);
  after.of_one = known.branches.size() == 1 ? known.of_one + 1 : 0;
  const std::vector<PoseFit> fits =
      seen.minima(predictions, after.of_one % k_second_every == 0 ? Minima::all : Minima::predicted);
  if (fits.empty()) return after;
  if (was_lost) return started(known.body, seen, fits, captured_at);
  if (auto branches = advanced_branches(known, seen, fits, unseen, model)) {
    after.branches = std::move(*branches);
    note_measured(seen, fits, captured_at, &after);
    return after;
  }
  if (++after.misfits >= k_misfits_believed) return started(known.body, seen, fits, captured_at);
  return after;
}

}  // namespace

std::optional<PoseFit> BodyEvidence::posterior(const PosePrior& prior, const Pose& start) const {
  return fit_pose(points_at(start).observations, start, k_huber, &prior);
}

double lost_after_s(const BodyFilter& motion, const MotionModel& model) {
  constexpr double k_gaps = 1.5;
  return std::max(model.extrapolation_limit_s, k_gaps * std::min(motion.gaps_s[0], motion.gaps_s[1]));
}

MotionNoise still_noise(const MotionModel& model) {
  return {.turn_drift = model.turn_drift * model.turn_drift, .drift = model.drift * model.drift};
}

MotionNoise moving_noise(const MotionModel& model) {
  return {.turn_jerk = model.turn_jerk, .jerk = model.jerk};
}

std::vector<Pose> expected_poses(const BodyFilter& known, Stamp at, const MotionModel& model) {
  std::vector<Pose> poses;
  const double unseen = seconds_between(known.measured_at, at);
  if (unseen > lost_after_s(known, model)) return poses;
  for (const Branch& branch : known.branches)
    poses.push_back(pose_after(branch.moving, std::clamp(unseen, 0.0, model.extrapolation_limit_s)));
  return poses;
}

std::optional<BodyFilter> advanced(const BodyFilter* known,
                                   const std::string& body,
                                   const BodyEvidence& seen,
                                   Stamp captured_at,
                                   const MotionModel& model) {
  if (!known) {
    const std::vector<PoseFit> fits = seen.minima({}, Minima::all);
    if (fits.empty()) return std::nullopt;
    return started(body, seen, fits, captured_at);
  }
  if (captured_at <= known->looked_at) return *known;
  BodyFilter last = *known;
  last.gaps_s = {known->gaps_s[1], seconds_between(known->looked_at, captured_at)};
  BodyFilter after = seen_again(last, seen, captured_at, model);
  after.gaps_s = last.gaps_s;
  return after;
}

std::vector<BodyFilter> observed(std::span<const BodyFilter> known,
                                 std::span<const Body> bodies,
                                 std::span<const View> views,
                                 Stamp captured_at,
                                 const MotionModel& model) {
  std::vector<BodyFilter> motions;
  for (const Body& body : bodies) {
    const auto before =
        std::find_if(known.begin(), known.end(), [&](const BodyFilter& m) { return m.body == body.name; });
    const MarkerEvidence seen(correspondences(body, views));
    auto after = advanced(before == known.end() ? nullptr : &*before, body.name, seen, captured_at, model);
    if (after) motions.push_back(std::move(*after));
  }
  return motions;
}

}  // namespace limn::tracker
