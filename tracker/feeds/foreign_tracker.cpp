#include "tracker/feeds/foreign_tracker.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace limn::tracker {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double k_degrees = 180 / std::numbers::pi;
constexpr double k_silent_s = 0.3;    // after this time without a pose a sensor counts as lost
constexpr double k_fresh_s = 0.1;     // for so long after its last message a body counts as measured
constexpr double k_unknown_turn = 2;  // rad: of a sensor that states no rotation
constexpr double k_farthest_m = 1e5;

// A pose that was measured by somebody else.
class PoseEvidence : public BodyEvidence {
 public:
  PoseEvidence(Pose pose, const Matrix6d& covariance) : pose_(std::move(pose)), covariance_(covariance) {}
  std::optional<PoseFit> posterior(const PosePrior& prior, const Pose&) const override {
    const Matrix6d measured = covariance_.llt().solve(Matrix6d::Identity());
    const Vector6d apart = boxminus(pose_, prior.world_from_body);
    const Matrix6d covariance = (prior.information + measured).llt().solve(Matrix6d::Identity());
    const Vector6d step = covariance * (measured * apart), rest = apart - step;
    return PoseFit{boxplus(prior.world_from_body, step), covariance,
                   step.dot(prior.information * step) + rest.dot(measured * rest), 0};
  }
  ChosenCorners points_at(const Pose&) const override { return {}; }
  double further_cost(const Pose&) const override { return 0; }
  std::vector<PoseFit> minima(std::span<const Pose>, Minima) const override {
    return {PoseFit{pose_, covariance_, 0, 0}};
  }

 private:
  Pose pose_;
  Matrix6d covariance_;
};

// Takes motions in a feed's frame to the body's in the room.
class Transfer {
 public:
  explicit Transfer(const Registration& registration) : registration_(registration) {}

  Pose pose(const Pose& feed_from_sensor) const { return registration_.world_from_body(feed_from_sensor); }

  Motion motion(const Motion& sensor) const {
    Motion out;
    Matrix6d of_registration;
    out.world_from_body = registration_.world_from_body(sensor.world_from_body, &of_registration);
    const Matrix6d by = derivative(out.world_from_body);
    out.velocity = by * sensor.velocity;
    out.acceleration = by * sensor.acceleration;
    Matrix18d all = Matrix18d::Zero();
    for (int block = 0; block < 3; ++block) all.block<6, 6>(6 * block, 6 * block) = by;
    out.covariance = all * sensor.covariance * all.transpose();
    const double delay_s = registration_.delay.stddev_s;
    out.covariance.topLeftCorner<6, 6>() +=
        of_registration + delay_s * delay_s * out.velocity * out.velocity.transpose();
    return out;
  }

  Fix fix(const Fix& sensor) const {
    Matrix6d of_registration;
    const Pose pose = registration_.world_from_body(sensor.world_from_body, &of_registration);
    const Matrix6d by = derivative(pose);
    return {pose, by * sensor.covariance * by.transpose() + of_registration,
            shifted(sensor.captured_at, -registration_.delay.seconds)};
  }

 private:
  // How a perturbation (or velocity) of the sensor moves the body's origin, which is `lever` behind it.
  Matrix6d derivative(const Pose& world_from_body) const {
    const Matrix3d turned = registration_.hand_eye.world_from_feed.rotation_matrix();
    const Vector3d lever = world_from_body.rotation * registration_.hand_eye.body_from_sensor.translation;
    Matrix6d by = Matrix6d::Zero();
    by.block<3, 3>(0, 0) = by.block<3, 3>(3, 3) = turned;
    by.block<3, 3>(3, 0) = skew(lever) * turned;
    return by;
  }

  const Registration& registration_;
};

FeedNoise noise_of(const ForeignPose& pose) {
  FeedNoise noise;
  noise.is_stated = pose.stddev_m.has_value() || pose.stddev_rad.has_value();
  constexpr double k_least_shift = 1e-5, k_least_turn = 1e-5;
  if (pose.stddev_m) noise.shift = std::max(k_least_shift, *pose.stddev_m);
  if (pose.stddev_rad) noise.turn = std::max(k_least_turn, *pose.stddev_rad);
  return noise;
}

bool is_usable(const ForeignPose& pose) {
  constexpr double k_off_unit = 1e-3;
  return pose.is_lost || (pose.feed_from_sensor.is_finite() &&
                          std::abs(pose.feed_from_sensor.rotation.norm() - 1) < k_off_unit &&
                          pose.feed_from_sensor.translation.cwiseAbs().maxCoeff() <= k_farthest_m);
}

Motion believed(const Branch& branch) {
  return mixed(branch.still, branch.still_weight, branch.moving, 1 - branch.still_weight);
}

Branch at_moment(const Branch& branch, double seconds, const MotionModel& model) {
  return {propagated(branch.still, seconds, still_noise(model)),
          propagated(branch.moving, seconds, moving_noise(model)), branch.still_weight, branch.weight};
}

// The log likelihood that two independent estimates are of one body, except for a constant.
double log_agreement(const Motion& a, const Motion& b) {
  const Vector6d apart = boxminus(b.world_from_body, a.world_from_body);
  const Matrix6d covariance = a.pose_covariance() + b.pose_covariance();
  return -0.5 * apart.dot(covariance.llt().solve(apart));
}

Branch combined(const Branch& a, const Branch& b) {
  const double still = a.still_weight * b.still_weight, moving = (1 - a.still_weight) * (1 - b.still_weight);
  return {combined(a.still, b.still), combined(a.moving, b.moving),
          std::clamp(still / (still + moving), 1e-9, 1 - 1e-9), a.weight};
}

bool is_lost_at(const BodyFilter& motion, Stamp at, const MotionModel& model) {
  return seconds_between(motion.measured_at, at) > lost_after_s(motion, model);
}

std::string described(const FeedStatus& status) {
  const std::string what = fmt::format("tracker {}: {}", status.feed, status.body);
  switch (status.state) {
    case FeedState::waiting:
      return what + " waits for its first pose.";
    case FeedState::collecting:
      return fmt::format("{} sends poses; to register it, {}.", what, status.advice);
    case FeedState::registered:
      return fmt::format(
          "{} is registered to the room within {:.1f} mm and {:.2f} degrees{}.{}", what, status.stddev_mm,
          status.stddev_deg,
          status.delay ? fmt::format(", {:.0f} ms behind the cameras", 1e3 * status.delay->seconds) : "",
          status.advice.empty() ? "" : " " + status.advice);
    case FeedState::lost:
      return fmt::format("{} is lost: {}.", what, status.advice);
    case FeedState::disagrees:
      return fmt::format("{} is not used: {}.", what, status.advice);
  }
  LIMN_CHECK(false);
}

}  // namespace

ForeignTracker::ForeignTracker(FeedSetup setup) : setup_(std::move(setup)) {
  for (const FeedBody& body : setup_.bodies) sensors_.push_back({.setup = body});
}

void ForeignTracker::receive(std::span<const ArrivedPose> poses) {
  if (poses.size() > k_most_at_once) poses = poses.last(k_most_at_once);
  for (const ArrivedPose& arrived : poses) {
    const auto sensor = std::ranges::find_if(
        sensors_, [&](const Sensor& s) { return s.setup.sensor == arrived.pose.sensor; });
    if (sensor == sensors_.end()) continue;
    if (is_usable(arrived.pose))
      receive(arrived, &*sensor);
    else
      ++refused_;
  }
}

void ForeignTracker::receive(const ArrivedPose& arrived, Sensor* sensor) {
  const ForeignPose& pose = arrived.pose;
  if (sensor->arrived_at && arrived.arrived_at < *sensor->arrived_at) return;
  sensor->is_lost = pose.is_lost;
  if (pose.is_lost) return;
  sensor->arrived_at = arrived.arrived_at;
  sensor->has_rotation = pose.has_rotation;
  sensor->noise = noise_of(pose);
  const Stamp at = clock_.moment_of(pose.time_s, arrived.arrived_at);
  if (pose.has_rotation) sensor->registration.add_sample({at, pose.feed_from_sensor}, sensor->noise);
  FeedNoise noise = sensor->noise;
  if (const auto found = registration_of(*sensor)) {
    noise.turn = std::max(noise.turn, found->noise.turn);
    noise.shift = std::max(noise.shift, found->noise.shift);
  }
  if (!pose.has_rotation) noise.turn = k_unknown_turn;
  if (sensor->motion && at <= sensor->motion->looked_at) {
    // A clock that was set back starts a new motion; a message that was overtaken is left out.
    constexpr double k_overtaken_s = 1;
    if (seconds_between(at, sensor->motion->looked_at) > k_overtaken_s)
      sensor->motion.reset();
    else
      return;
  }
  sensor->motion = advanced(sensor->motion ? &*sensor->motion : nullptr, sensor->setup.body,
                            PoseEvidence(pose.feed_from_sensor, noise.covariance()), at);
}

void ForeignTracker::add_own(const std::string& body, const Fix& own) {
  for (Sensor& sensor : sensors_)
    if (sensor.setup.body == body) sensor.registration.add_own(own);
}

void ForeignTracker::update() {
  for (Sensor& sensor : sensors_) sensor.registration.update();
}

// By its own simultaneous poses; else by the frame that the file gives or that another body has registered.
std::optional<Registration> ForeignTracker::registration_of(const Sensor& sensor) const {
  if (sensor.registration.registration()) return sensor.registration.registration();
  if (!sensor.has_rotation && !sensor.setup.needs_position_only) return std::nullopt;
  if (sensor.registration.disagrees()) return std::nullopt;
  Registration out;
  out.noise = sensor.noise;
  out.delay = {setup_.delay_s, 0};
  if (setup_.world_from_feed) {
    out.hand_eye.world_from_feed = *setup_.world_from_feed;
  } else {
    const Registration* best = nullptr;
    const auto spread = [](const Registration& r) {
      return r.hand_eye.covariance.topLeftCorner<6, 6>().trace();
    };
    for (const Sensor& other : sensors_)
      if (const auto& found = other.registration.registration();
          found && (!best || spread(*found) < spread(*best)))
        best = &*found;
    if (!best) return std::nullopt;
    out = *best;
    out.hand_eye.covariance.bottomRows<6>().setZero();
    out.hand_eye.covariance.rightCols<6>().setZero();
  }
  out.hand_eye.body_from_sensor = sensor.setup.body_from_sensor.value_or(Pose());
  return out;
}

std::vector<BodyFilter> ForeignTracker::motions(Stamp now) const {
  std::vector<BodyFilter> out;
  for (const Sensor& sensor : sensors_) {
    if (!sensor.motion || !sensor.arrived_at) continue;
    const auto registration = registration_of(sensor);
    if (!registration) continue;
    const Transfer transfer(*registration);
    BodyFilter motion = *sensor.motion;
    for (Branch& branch : motion.branches) {
      branch.still = transfer.motion(branch.still);
      branch.moving = transfer.motion(branch.moving);
    }
    for (Fix& fix : motion.fixes) fix = transfer.fix(fix);
    motion.measured_at = shifted(motion.measured_at, -registration->delay.seconds);
    const bool is_fresh = !sensor.is_lost && seconds_between(*sensor.arrived_at, now) <= k_fresh_s;
    motion.looked_at = is_fresh ? motion.measured_at : std::max(now, shifted(motion.measured_at, 1e-3));
    out.push_back(std::move(motion));
  }
  return out;
}

FeedStatus ForeignTracker::status_of(const Sensor& sensor, Stamp now) const {
  FeedStatus status{setup_.name, sensor.setup.body};
  if (!sensor.arrived_at && !sensor.is_lost) return status;
  const double silent_s = sensor.arrived_at ? seconds_between(*sensor.arrived_at, now) : 0;
  if (sensor.is_lost || silent_s > k_silent_s) {
    status.state = FeedState::lost;
    status.advice = sensor.is_lost ? "the tracker does not see it" : "its poses have ended";
    return status;
  }
  const auto registration = registration_of(sensor);
  if (!registration) {
    status.state = sensor.registration.disagrees() ? FeedState::disagrees : FeedState::collecting;
    status.advice = sensor.registration.advice();
    if (status.state == FeedState::disagrees)
      status.advice = fmt::format("the cameras see its body {:.0f} mm away. It is registered anew: {}",
                                  sensor.registration.off_mm(), status.advice);
    if (!sensor.has_rotation)
      status.advice =
          "give world_from_feed, or let another body of this tracker register it: it states "
          "positions only, which are enough for a viewer's eye";
    return status;
  }
  status.state = FeedState::registered;
  if (sensor.registration.registration()) status.delay = registration->delay;
  Matrix6d covariance;
  static_cast<void>(
      registration->world_from_body(sensor.motion->branches.front().moving.world_from_body, &covariance));
  const Vector6d stddev = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  status.stddev_deg = stddev.head<3>().maxCoeff() * k_degrees;
  status.stddev_mm = 1e3 * stddev.tail<3>().maxCoeff();
  const Pose& feed_from_sensor = sensor.motion->branches.front().moving.world_from_body;
  if (setup_.world_from_feed && sensor.registration.registration()) {
    const double off_m = (*setup_.world_from_feed * feed_from_sensor.translation -
                          registration->hand_eye.world_from_feed * feed_from_sensor.translation)
                             .norm();
    constexpr double k_noteworthy_m = 0.01;
    if (off_m > k_noteworthy_m)
      status.advice = fmt::format("Its world_from_feed in the file is off by {:.0f} mm there.", 1e3 * off_m);
  }
  if (registration->delay.seconds > k_silent_s)
    status.advice = "Its poses come too late to be used where the cameras do not see the body.";
  return status;
}

std::vector<FeedStatus> ForeignTracker::statuses(Stamp now) const {
  std::vector<FeedStatus> out;
  for (const Sensor& sensor : sensors_) out.push_back(status_of(sensor, now));
  return out;
}

std::vector<std::string> ForeignTracker::take_notes(Stamp now) {
  std::vector<std::string> notes;
  for (Sensor& sensor : sensors_) {
    const FeedStatus status = status_of(sensor, now);
    if (status.state != sensor.reported) notes.push_back(described(status));
    sensor.reported = status.state;
  }
  if (const auto note = clock_.take_note())
    notes.push_back(fmt::format("tracker {}: {}.", setup_.name, *note));
  if (refused_ > 0 && !std::exchange(is_refusal_reported_, true))
    notes.push_back(fmt::format(
        "tracker {}: poses with numbers that are not finite, or no rotation, are left out.", setup_.name));
  return notes;
}

BodyFilter combined(const BodyFilter* camera, const BodyFilter& feed, const MotionModel& model) {
  if (!camera || camera->branches.empty() || camera->images_to_confirm > 0) return feed;
  const Stamp at = std::max(camera->measured_at, feed.measured_at);
  if (is_lost_at(*camera, at, model)) return feed;
  if (is_lost_at(feed, at, model)) return *camera;
  BodyFilter out = *camera;
  const Branch by_feed = at_moment(feed.branches.front(), seconds_between(feed.measured_at, at), model);
  const Motion stated = believed(by_feed);
  std::vector<double> logs;
  for (Branch& branch : out.branches) {
    const Branch by_camera = at_moment(branch, seconds_between(camera->measured_at, at), model);
    logs.push_back(std::log(branch.weight) + log_agreement(believed(by_camera), stated));
    branch = combined(by_camera, by_feed);
  }
  const double highest = *std::ranges::max_element(logs);
  double sum = 0;
  for (const double log : logs) sum += std::exp(log - highest);
  for (std::size_t i = 0; i < logs.size(); ++i) out.branches[i].weight = std::exp(logs[i] - highest) / sum;
  std::ranges::sort(out.branches, std::greater(), &Branch::weight);
  if (feed.measured_at > camera->measured_at) out.fixes = feed.fixes;
  out.measured_at = at;
  const bool is_measured = camera->looked_at == camera->measured_at || feed.looked_at == feed.measured_at;
  out.looked_at = is_measured ? at : std::max({camera->looked_at, feed.looked_at, at});
  return out;
}

}  // namespace limn::tracker
