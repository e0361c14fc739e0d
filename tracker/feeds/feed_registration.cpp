#include "tracker/feeds/feed_registration.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace limn::tracker {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6x12d = Eigen::Matrix<double, 6, 12>;

constexpr double k_degrees = 180 / std::numbers::pi;
constexpr double k_remembered_s = 6;          // poses of both systems
constexpr double k_nearest_samples_s = 4e-3;  // samples that come faster are left out
constexpr std::size_t k_most_samples = 1600, k_most_own = 1000;
// Between samples further apart nothing is interpolated. The velocity is taken over twice k_velocity_s.
constexpr double k_widest_gap_s = 0.12, k_velocity_s = 0.05;
constexpr std::size_t k_most_pairs = 80;
constexpr int k_least_pairs = 12, k_fresh_pairs = 4;
constexpr double k_between_tries_s = 0.5;
// Pairs that differ by less than this are like each other.
constexpr double k_like_turn = 5 / k_degrees, k_like_shift = 0.02;
// Speeds are compared over this span, which is long enough for the noise of a camera's poses.
constexpr double k_speed_span_s = 0.1, k_fastest_turn = 20;
constexpr std::size_t k_most_interleaved = 6;  // speeds in each span
// How well messages are stamped: their jitter, standard deviation.
constexpr double k_stamp_stddev_s = 2e-3;
constexpr double k_least_noise_share = 0.2;  // as a share of the assumed noise
constexpr double k_outlier = 4;              // standard deviations
// A registration is used when it takes the body to its place with these standard deviations.
constexpr double k_usable_shift = 5e-3, k_usable_turn = 1 / k_degrees;
// Beyond this chi² of six degrees of freedom a pair contradicts the registration (probability 1e-7), and so
// many of them in a row end it.
constexpr double k_contradicts = 45;
constexpr int k_contradictions = 30;
constexpr double k_least_misfit = 6;  // normalised residuals of poses that do not belong together

Matrix6d diagonal(double turn, double shift) {
  Vector6d deviations;
  deviations << Vector3d::Constant(turn), Vector3d::Constant(shift);
  return deviations.cwiseAbs2().asDiagonal();
}

// A pair's residual by a solution, and its covariance by the error of our pose and of the feed's.
struct Residual {
  Vector6d value;
  Matrix6d of_body, of_sensor;
};

Residual residual_of(const PosePair& pair, const HandEye& at) {
  const Matrix3d turned = at.world_from_feed.rotation_matrix();
  Matrix6d by_body = Matrix6d::Identity(), by_sensor = Matrix6d::Zero();
  by_body.block<3, 3>(3, 0) = -skew(pair.world_from_body.rotation * at.body_from_sensor.translation);
  by_sensor.block<3, 3>(0, 0) = by_sensor.block<3, 3>(3, 3) = turned;
  return {boxminus(pair.world_from_body * at.body_from_sensor, at.world_from_feed * pair.feed_from_sensor),
          by_body * pair.body_covariance * by_body.transpose(),
          by_sensor * pair.sensor_covariance * by_sensor.transpose()};
}

double chi_square(const Vector6d& residual, const Matrix6d& covariance) {
  return residual.dot(covariance.llt().solve(residual));
}

// How much two poses differ: 1 where they are just not like each other.
double difference(const Pose& a, const Pose& b) {
  return std::max(angle_between(a.rotation, b.rotation) / k_like_turn,
                  (a.translation - b.translation).norm() / k_like_shift);
}

// Speeds over k_speed_span_s: consecutive poses of every third image, for example, interleaved.
std::vector<TurnSpeed> speeds_of(const std::vector<TimedRotation>& rotations) {
  if (rotations.size() < 3) return {};
  const double interval_s =
      (rotations.back().at_s - rotations.front().at_s) / static_cast<double>(rotations.size() - 1);
  const auto stride = static_cast<std::size_t>(
      std::clamp(std::round(k_speed_span_s / std::max(1e-3, interval_s)), 1.0, 50.0));
  const std::size_t step = 1 + stride / k_most_interleaved;
  std::vector<TurnSpeed> speeds;
  for (std::size_t first = 0; first < stride; first += step) {
    std::vector<TimedRotation> every;
    for (std::size_t i = first; i < rotations.size(); i += stride) every.push_back(rotations[i]);
    for (const TurnSpeed& speed : turn_speeds(every))
      if (speed.rad_per_s < k_fastest_turn) speeds.push_back(speed);
  }
  std::ranges::sort(speeds, {}, &TurnSpeed::at_s);
  return speeds;
}

double cauchy_weight(double chi_square) { return 1 / (1 + chi_square / 6 / (k_outlier * k_outlier / 4)); }

}  // namespace

Matrix6d FeedNoise::covariance() const { return diagonal(turn, shift); }

Pose Registration::world_from_body(const Pose& feed_from_sensor, Matrix6d* covariance) const {
  const Pose &y = hand_eye.world_from_feed, &x = hand_eye.body_from_sensor;
  const Pose out = y * feed_from_sensor * x.inverse();
  if (!covariance) return out;
  // Derivative by the perturbations of y and x: y turns all about the feed's origin, x the body about the
  // sensor.
  const Matrix3d turned = out.rotation_matrix();
  const Vector3d lever = out.rotation * x.translation;
  Matrix6x12d by = Matrix6x12d::Zero();
  by.block<3, 3>(0, 0) = Matrix3d::Identity();
  by.block<3, 3>(0, 6) = -turned;
  by.block<3, 3>(3, 0) = -skew(y.rotation * feed_from_sensor.translation) + skew(lever);
  by.block<3, 3>(3, 3) = Matrix3d::Identity();
  by.block<3, 3>(3, 6) = -skew(lever) * turned;
  by.block<3, 3>(3, 9) = -turned;
  *covariance = by * hand_eye.covariance * by.transpose();
  return out;
}

void FeedRegistration::add_sample(const FeedSample& sample, const FeedNoise& noise) {
  noise_ = noise;
  if (!samples_.empty() && seconds_between(samples_.back().at, sample.at) < k_nearest_samples_s) return;
  samples_.push_back(sample);
  while (samples_.size() > k_most_samples || seconds_between(samples_.front().at, sample.at) > k_remembered_s)
    samples_.pop_front();
}

void FeedRegistration::add_own(const Fix& own) {
  if (!own_.empty() && own.captured_at <= own_.back().captured_at) return;
  own_.push_back(own);
  ++unpaired_;
  while (own_.size() > k_most_own ||
         seconds_between(own_.front().captured_at, own.captured_at) > k_remembered_s)
    own_.pop_front();
  unpaired_ = std::min(unpaired_, own_.size());
}

void FeedRegistration::update() {
  if (samples_.empty() || own_.empty()) return;
  if (!delay_) find_delay();
  if (!delay_) return;
  while (unpaired_ > 0) {
    const Fix& own = own_[own_.size() - unpaired_];
    const double newest_s = seconds_between(own.captured_at, samples_.back().at);
    if (newest_s < delay_->seconds + k_velocity_s) break;
    --unpaired_;
    const auto pair = pair_of(own);
    if (!pair) continue;
    if (registration_) check(*pair);
    keep(*pair);
  }
  if (fresh_pairs_ >= k_fresh_pairs &&
      (!tried_at_ || seconds_between(*tried_at_, own_.back().captured_at) >= k_between_tries_s))
    solve();
}

// nullopt: the feed has no poses around that moment.
std::optional<FeedRegistration::Pair> FeedRegistration::pair_of(const Fix& own) const {
  const Stamp at = shifted(own.captured_at, delay_->seconds);
  const auto after = std::ranges::lower_bound(samples_, at, {}, &FeedSample::at);
  if (after == samples_.begin() || after == samples_.end()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap_s = seconds_between(before->at, after->at);
  if (gap_s > k_widest_gap_s) return std::nullopt;
  const double share = seconds_between(before->at, at) / gap_s;
  auto first = before, last = after;
  while (first != samples_.begin() && seconds_between(first->at, at) < k_velocity_s) --first;
  while (std::next(last) != samples_.end() && seconds_between(at, last->at) < k_velocity_s) ++last;
  const double span_s = seconds_between(first->at, last->at);
  if (span_s > 4 * k_velocity_s + 2 * k_widest_gap_s) return std::nullopt;
  return Pair{own, interpolated(before->feed_from_sensor, after->feed_from_sensor, share),
              boxminus(last->feed_from_sensor, first->feed_from_sensor) / span_s, delay_->seconds,
              share * share + (1 - share) * (1 - share)};
}

// A pair like an earlier one replaces it; when all places are taken, one of the two that are most alike goes.
void FeedRegistration::keep(const Pair& pair) {
  const auto like = [&](const Pair& other) {
    return difference(pair.own.world_from_body, other.own.world_from_body);
  };
  const auto nearest = std::ranges::min_element(pairs_, {}, [&](const Pair& other) { return like(other); });
  if (nearest != pairs_.end() && like(*nearest) < 1) {
    constexpr double k_old_s = 20;
    const bool is_old = seconds_between(nearest->own.captured_at, pair.own.captured_at) > k_old_s;
    if (!is_old && pair.velocity.squaredNorm() >= nearest->velocity.squaredNorm()) return;
    *nearest = pair;
    ++fresh_pairs_;
    return;
  }
  ++fresh_pairs_;
  pairs_.push_back(pair);
  if (pairs_.size() <= k_most_pairs) return;
  std::size_t most_alike = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < pairs_.size(); ++i)
    for (std::size_t k = i + 1; k < pairs_.size(); ++k)
      if (const double d = difference(pairs_[i].own.world_from_body, pairs_[k].own.world_from_body);
          d < least) {
        least = d;
        most_alike = i;  // the older one
      }
  pairs_.erase(pairs_.begin() + static_cast<std::ptrdiff_t>(most_alike));
}

void FeedRegistration::check(const Pair& pair) {
  Matrix6d sensor = pair.averaged * registration_->noise.covariance();
  const double time_s = std::hypot(k_stamp_stddev_s, registration_->delay.stddev_s);
  sensor += time_s * time_s * pair.velocity * pair.velocity.transpose();
  const PosePair both{pair.own.world_from_body, pair.feed_from_sensor, pair.own.covariance, sensor};
  const Residual residual = residual_of(both, registration_->hand_eye);
  Matrix6d of_registration;
  const Pose stated = registration_->world_from_body(pair.feed_from_sensor, &of_registration);
  const double off = chi_square(residual.value, residual.of_body + residual.of_sensor + of_registration);
  contradictions_ = off > k_contradicts ? contradictions_ + 1 : std::max(0, contradictions_ - 2);
  if (contradictions_ < k_contradictions) return;
  off_mm_ = 1e3 * (stated.translation - pair.own.world_from_body.translation).norm();
  restart();
}

void FeedRegistration::restart() {
  registration_.reset();
  delay_.reset();
  pairs_.clear();
  fresh_pairs_ = contradictions_ = 0;
  disagrees_ = true;
  advice_ = "move and turn it in view of the cameras";
}

void FeedRegistration::find_delay() {
  if (tried_at_ && seconds_between(*tried_at_, own_.back().captured_at) < k_between_tries_s) return;
  tried_at_ = own_.back().captured_at;
  std::vector<TimedRotation> own, feed;
  for (const Fix& fix : own_) own.push_back({seconds_of(fix.captured_at), fix.world_from_body.rotation});
  for (const FeedSample& sample : samples_)
    feed.push_back({seconds_of(sample.at), sample.feed_from_sensor.rotation});
  const auto delay = estimate_delay(speeds_of(own), speeds_of(feed));
  if (!delay) {
    advice_ = "turn it to and fro in view of the cameras (" + delay.message() + ")";
    return;
  }
  delay_ = *delay;
  tried_at_.reset();
}

std::vector<PosePair> FeedRegistration::pose_pairs(double delay_s, const FeedNoise& noise) const {
  std::vector<PosePair> out;
  for (const Pair& pair : pairs_) {
    const Vector6d later = (delay_s - pair.delay_s) * pair.velocity;
    out.push_back({pair.own.world_from_body, boxplus(pair.feed_from_sensor, later), pair.own.covariance,
                   pair.averaged * noise.covariance() +
                       k_stamp_stddev_s * k_stamp_stddev_s * pair.velocity * pair.velocity.transpose()});
  }
  return out;
}

// The change of the delay that reduces the residuals most: a later sensor's pose lies further along its
// motion.
double FeedRegistration::refined_delay(const std::vector<PosePair>& pairs,
                                       const HandEye& solution,
                                       double* stddev_s) const {
  // Pairs of a body that stands still say nothing; then the delay stays as it was.
  constexpr double k_least_prior_s = 5e-3;
  const double prior_s = std::max(delay_->stddev_s, k_least_prior_s);
  double right = 0, matrix = 1 / (prior_s * prior_s);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Residual residual = residual_of(pairs[i], solution);
    const Matrix6d covariance = residual.of_body + residual.of_sensor;
    Vector6d along;
    along << solution.world_from_feed.rotation * pairs_[i].velocity.head<3>(),
        solution.world_from_feed.rotation * pairs_[i].velocity.tail<3>();
    const Vector6d weighted =
        cauchy_weight(chi_square(residual.value, covariance)) * covariance.llt().solve(along);
    right += weighted.dot(residual.value);
    matrix += weighted.dot(along);
  }
  *stddev_s = std::max(1.0, solution.normalised_rms) / std::sqrt(matrix);
  constexpr double k_most_s = 0.02;
  return std::clamp(right / matrix, -k_most_s, k_most_s);
}

// What the residuals hold beyond the errors of our own poses, by moments, for rotation and position apart.
FeedNoise FeedRegistration::measured_noise(const std::vector<PosePair>& pairs,
                                           const HandEye& solution) const {
  double squares[2] = {0, 0}, own[2] = {0, 0}, sensor[2] = {0, 0};
  int used = 0;
  for (const PosePair& pair : pairs) {
    const Residual residual = residual_of(pair, solution);
    if (chi_square(residual.value, residual.of_body + residual.of_sensor) > 6 * k_outlier * k_outlier)
      continue;
    ++used;
    for (int k = 0; k < 2; ++k) {
      squares[k] += residual.value.segment<3>(3 * k).squaredNorm();
      own[k] += residual.of_body.block<3, 3>(3 * k, 3 * k).trace();
      sensor[k] += residual.of_sensor.block<3, 3>(3 * k, 3 * k).trace();
    }
  }
  const double freedom = used > 3 ? (6.0 * used - 13) / (6.0 * used) : 1;
  const double least = noise_.is_stated ? 1 : k_least_noise_share;
  const auto share = [&](int k) {
    return sensor[k] > 0
               ? std::max(least, std::sqrt(std::max(0.0, squares[k] / freedom - own[k]) / sensor[k]))
               : 1;
  };
  FeedNoise out = noise_;
  out.turn *= share(0);
  out.shift *= share(1);
  return out;
}

void FeedRegistration::solve() {
  tried_at_ = own_.back().captured_at;
  if (static_cast<int>(pairs_.size()) < k_least_pairs) {
    advice_ = fmt::format("move and turn it in view of the cameras ({} of {} different poses)", pairs_.size(),
                          k_least_pairs);
    return;
  }
  fresh_pairs_ = 0;
  FeedNoise noise = noise_;
  Delay delay = *delay_;
  Result<HandEye> solution = error("not solved");
  for (int round = 0; round < 4; ++round) {
    solution = solve_hand_eye(pose_pairs(delay.seconds, noise));
    if (!solution) break;
    const std::vector<PosePair> pairs = pose_pairs(delay.seconds, noise);
    if (round == 1) noise = measured_noise(pairs, *solution);
    delay.seconds += refined_delay(pairs, *solution, &delay.stddev_s);
  }
  if (!solution) {
    advice_ = "turn it to and fro and nod it, in view of the cameras (" + solution.message() + ")";
    return;
  }
  Registration found{*solution, delay, noise, static_cast<int>(pairs_.size())};
  if (2 * found.hand_eye.outliers > found.pairs ||
      noise.shift > k_least_misfit * std::max(noise_.shift, 2e-3) ||
      noise.turn > k_least_misfit * std::max(noise_.turn, 0.5 / k_degrees)) {
    advice_ = fmt::format(
        "its poses do not move as the body does (off by {:.0f} mm and {:.1f} degrees). Is it fixed to this "
        "body, are its units right, and is its frame right-handed (\"left_handed\")?",
        1e3 * noise.shift, noise.turn * k_degrees);
    registration_.reset();
    return;
  }
  Matrix6d covariance;
  static_cast<void>(found.world_from_body(pairs_.back().feed_from_sensor, &covariance));
  const Vector6d stddev = covariance.diagonal().cwiseSqrt();
  if (stddev.head<3>().maxCoeff() > k_usable_turn || stddev.tail<3>().maxCoeff() > k_usable_shift) {
    advice_ = fmt::format("move and turn it further (so far {:.1f} mm and {:.1f} degrees)",
                          1e3 * stddev.tail<3>().maxCoeff(), stddev.head<3>().maxCoeff() * k_degrees);
    return;
  }
  delay_ = delay;
  registration_ = found;
  disagrees_ = false;
  advice_.clear();
}

}  // namespace limn::tracker
