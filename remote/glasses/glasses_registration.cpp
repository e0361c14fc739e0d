#include "remote/glasses/glasses_registration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tracker/pose_fit.h"

namespace limn::remote {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using tracker::PosePair;
using tracker::skew;

constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_kept_s = 12;               // poses, and markers that the filter starts from
constexpr double k_least_interval_s = 0.015;  // between two poses; nearer ones are a flood and left out
constexpr double k_gap_s = 0.25;              // longer gaps between poses are not interpolated
constexpr double k_rest_gap_s = 0.8, k_rest_m = 1e-3, k_rest_rad = 0.2 * k_degree;
constexpr double k_silent_s = 1;  // without poses for so long the glasses are lost
constexpr double k_unseen_s = 3;  // without the marker for so long it is reported
constexpr double k_clock_jump_s = 1;
constexpr double k_unit_tolerance = 0.02, k_farthest_m = 1000;
constexpr double k_start_interval_s = 0.25;  // between two attempts to start the filter
constexpr std::size_t k_least_pairs = 12, k_first_pairs = 100, k_most_pairs = 600;
constexpr double k_pair_interval_s = 0.012, k_still_interval_s = 0.5;
constexpr double k_moved_m = 5e-3, k_moved_rad = 1 * k_degree;
constexpr double k_start_rad = 6 * k_degree, k_start_m = 0.1,
                 k_start_delay_s = 0.01;                      // before the first pair
constexpr double k_delay_drift_s = 50e-6;                     // the clocks against each other, in a second
constexpr double k_gate = 22.5;                               // chi squared of 6 dimensions at 99.9 %
constexpr int k_contradicted_after = 8, k_trusted_after = 6;  // pairs in turn
// A head moves no faster; then the odometry has found itself elsewhere.
constexpr double k_fastest_m_s = 4, k_fastest_rad_s = 12;
constexpr double k_trusted_turn =
    8 * k_degree;                  // shows whether the marker's place on the glasses is still right
constexpr double k_worst_fit = 3;  // normalised residual beyond which the marker is another one's
constexpr double k_wanted_turn = 7 * k_degree;  // standard deviation

Matrix6d diagonal(double rotation, double translation) {
  Vector6d deviations;
  deviations << Vector3d::Constant(rotation), Vector3d::Constant(translation);
  return deviations.cwiseAbs2().asDiagonal();
}

double largest_deviation(const Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix3d>(covariance).eigenvalues()[2]));
}

bool has_moved(const Pose& from, const Pose& to, double most_m, double most_rad) {
  return (to.translation - from.translation).norm() > most_m ||
         angle_between(from.rotation, to.rotation) > most_rad;
}

// Whether a head at rest is where it was between two poses that are too far apart to interpolate motion.
bool is_at_rest(const OdometryPose& from, const OdometryPose& to) {
  return to.at_s - from.at_s <= k_rest_gap_s &&
         !has_moved(from.feed_from_eye, to.feed_from_eye, k_rest_m, k_rest_rad);
}

bool has_jumped(const Pose& from, const Pose& to, double seconds) {
  return (to.translation - from.translation).norm() > k_fastest_m_s * seconds ||
         angle_between(from.rotation, to.rotation) > k_fastest_rad_s * seconds;
}

// Covariance of a drift about the point p of the world, as perturbation of world_from_feed.
Matrix6d drift_about(const Vector3d& p, const Pose& world_from_feed, const Matrix6d& drift) {
  Matrix6d moved = Matrix6d::Identity();
  moved.block<3, 3>(3, 0) = -skew(world_from_feed.translation - p);
  return moved * drift * moved.transpose();
}

// The camera of a view in the world, with the axes of WebXR.
MeasuredMarker measured_camera(const MeasuredView& view, double at_s) {
  const Pose turned(Eigen::Quaterniond(0, 1, 0, 0), Vector3d::Zero());
  const Pose world_from_camera = view.camera_from_world.inverse();
  const Matrix3d r = world_from_camera.rotation_matrix();
  Matrix6d by_inverse = Matrix6d::Zero();
  by_inverse.topLeftCorner<3, 3>() = by_inverse.bottomRightCorner<3, 3>() = -r;
  by_inverse.bottomLeftCorner<3, 3>() = -r * skew(view.camera_from_world.translation);
  return {at_s, world_from_camera * turned, by_inverse * view.covariance * by_inverse.transpose(),
          by_inverse * view.by_lens};
}

}  // namespace

GlassesOptions camera_options() {
  GlassesOptions options;
  options.by_camera = true;
  options.odometry_m = 0.12e-3;
  options.odometry_rad = 0.25e-3;
  return options;
}

GlassesRegistration::GlassesRegistration(std::string marker, const GlassesOptions& options)
    : marker_(std::move(marker)), options_(options) {}

void GlassesRegistration::restart() {
  eyes_.clear();
  markers_.clear();
  first_.clear();
  last_marker_.reset();
  last_eye_.reset();
  filter_.reset();
  place_.reset();
  rejected_in_turn_ = accepted_since_start_ = 0;
  is_feed_new_ = false;
}

Status GlassesRegistration::add_eye(const Eigen::Vector4d& rotation_wxyz,
                                    const Vector3d& translation_m,
                                    double at_s,
                                    double received_at_s) {
  if (!rotation_wxyz.allFinite() || !translation_m.allFinite() || !std::isfinite(at_s))
    return error("glasses: expected a pose of finite numbers, found another. It is left out.");
  if (std::abs(rotation_wxyz.norm() - 1) > k_unit_tolerance)
    return error(
        "glasses: rotation_wxyz: expected a quaternion of length 1, found length {:.3g}. It is left out.",
        rotation_wxyz.norm());
  if (translation_m.norm() > k_farthest_m)
    return error("glasses: translation_m: expected a place within {} m, found {:.3g} m. It is left out.",
                 k_farthest_m, translation_m.norm());
  const double offset_s = received_at_s - at_s;
  if (!eyes_.empty() || filter_) {
    const double jump_s = offset_s - clock_offset_s_;
    const bool runs_back = !eyes_.empty() && at_s < eyes_.back().at_s - k_gap_s;
    if (runs_back || std::abs(jump_s) > k_clock_jump_s) {
      restart();
      return error("glasses: the page's clock jumped by {:.1f} s. The registration starts again.", jump_s);
    }
    if (!eyes_.empty() && at_s < eyes_.back().at_s + k_least_interval_s) return {};
  }
  // The filter's delay counts from the offset that it started with.
  if (!filter_ && (eyes_.empty() || offset_s < clock_offset_s_)) clock_offset_s_ = offset_s;
  const Eigen::Quaterniond rotation(rotation_wxyz[0], rotation_wxyz[1], rotation_wxyz[2], rotation_wxyz[3]);
  const Pose feed_from_eye(rotation, translation_m);
  if (!eyes_.empty() && has_jumped(eyes_.back().feed_from_eye, feed_from_eye, at_s - eyes_.back().at_s)) {
    set_lost();
    if (!filter_) last_eye_.reset();
  }
  eyes_.push_back({at_s, received_at_s, feed_from_eye});
  while (eyes_.front().at_s < at_s - k_kept_s) eyes_.pop_front();
  is_suspended_ = is_asleep_ = false;
  return {};
}

void GlassesRegistration::add_marker(const MeasuredMarker& marker) {
  if (options_.by_camera) return;
  if (!marker.world_from_marker.is_finite() || !marker.covariance.allFinite()) return;
  if (marker_seen_s_ && marker.at_s <= *marker_seen_s_) return;
  marker_seen_s_ = marker.at_s;
  markers_.push_back(marker);
  if (markers_.size() > k_most_pairs) markers_.pop_front();
}

void GlassesRegistration::add_view(const MeasuredView& view) {
  if (!std::isfinite(view.at_s) || !view.feed_from_camera.is_finite() ||
      !view.camera_from_world.is_finite() || !view.covariance.allFinite())
    return;
  if (is_suspended_ || eyes_.empty() || view.at_s < eyes_.front().at_s ||
      view.at_s > eyes_.back().at_s + k_gap_s)
    return;
  const MeasuredMarker camera = measured_camera(view, view.at_s + clock_offset_s_);
  if (marker_seen_s_ && camera.at_s <= *marker_seen_s_) return;
  marker_seen_s_ = camera.at_s;
  view_problem_.clear();
  if (!filter_) {
    filter_ = Filter();
    filter_->covariance.block<6, 6>(6, 6) = diagonal(options_.camera_rad, options_.camera_m);
    const Vector3d lens(options_.focal_share, options_.centre_share, options_.centre_share);
    filter_->covariance.bottomRightCorner<3, 3>() = lens.cwiseAbs2().asDiagonal();
    is_feed_new_ = true;
  }
  continue_with(camera, {view.feed_from_camera, Vector6d::Zero()});
}

void GlassesRegistration::set_lost() {
  is_suspended_ = true;
  is_feed_new_ = true;
  eyes_.clear();
  markers_.clear();
  if (!filter_) first_.clear();
}

void GlassesRegistration::set_asleep() {
  set_lost();
  is_asleep_ = true;
}

// The pose at a moment of the page's clock, by a cubic through the four poses around it; nullopt: it lies
// outside of the poses, or in a gap.
std::optional<GlassesRegistration::Moving> GlassesRegistration::eye_at(double page_s) const {
  const auto next = std::ranges::lower_bound(eyes_, page_s, {}, &OdometryPose::at_s);
  const auto index = next - eyes_.begin();
  if (index < 2 || index + 1 >= static_cast<std::ptrdiff_t>(eyes_.size())) return std::nullopt;
  const auto at = [&](int k) -> const OdometryPose& {
    return eyes_[static_cast<std::size_t>(index - 2 + k)];
  };
  if (at(2).at_s - at(1).at_s > k_gap_s) {
    if (!is_at_rest(at(1), at(2))) return std::nullopt;
    return Moving{at(1).feed_from_eye, Vector6d::Zero()};
  }
  Vector6d delta = Vector6d::Zero(), speed = Vector6d::Zero();
  for (int k = 0; k < 4; ++k) {
    if (k > 0 && at(k).at_s - at(k - 1).at_s > k_gap_s) return std::nullopt;
    double weight = 1, slope = 0;
    for (int j = 0; j < 4; ++j) {
      if (j == k) continue;
      const double span = at(k).at_s - at(j).at_s;
      slope = slope * (page_s - at(j).at_s) / span + weight / span;
      weight *= (page_s - at(j).at_s) / span;
    }
    const Vector6d from_second = boxminus(at(k).feed_from_eye, at(1).feed_from_eye);
    delta += weight * from_second;
    speed += slope * from_second;
  }
  return Moving{boxplus(at(1).feed_from_eye, delta), speed};
}

// Whether a pair brings something new: not only the same noise once more.
bool GlassesRegistration::is_new_place(const MeasuredMarker& marker, const Pose& feed_from_eye) const {
  if (!last_marker_ || !last_eye_) return true;
  const double seconds = marker.at_s - last_marker_->at_s;
  if (seconds < k_pair_interval_s) return false;
  return has_moved(*last_eye_, feed_from_eye, k_moved_m, k_moved_rad) || seconds > k_still_interval_s;
}

// Adds the drift since the filter's moment. The odometry turns about the head.
void GlassesRegistration::predict_to(double at_s, const Pose& feed_from_eye, Filter* filter) const {
  const double seconds = std::max(0.0, at_s - filter->at_s);
  filter->covariance.topLeftCorner<6, 6>() +=
      seconds * drift_about(filter->world_from_feed * feed_from_eye.translation, filter->world_from_feed,
                            diagonal(options_.drift_rad, options_.drift_m));
  filter->covariance(12, 12) += seconds * k_delay_drift_s * k_delay_drift_s;
  filter->at_s = std::max(filter->at_s, at_s);
}

GlassesRegistration::PairEquations GlassesRegistration::equations_at(const Filter& state,
                                                                     const MeasuredMarker& marker,
                                                                     const Moving& eye) const {
  const Pose a = boxplus(marker.world_from_marker, -marker.by_lens * state.lens);
  const Pose &x = state.marker_from_eye, &y = state.world_from_feed;
  const Matrix3d ra = a.rotation_matrix(), ry = y.rotation_matrix();
  PairEquations out;
  out.jacobian.setZero();
  out.jacobian.topLeftCorner<6, 6>() = -Matrix6d::Identity();
  out.jacobian.block<3, 3>(3, 0) = skew(y.rotation * eye.pose.translation);
  out.jacobian.block<3, 3>(0, 6) = out.jacobian.block<3, 3>(3, 9) = ra;
  out.jacobian.col(12) << ry * eye.speed.head<3>(), ry * eye.speed.tail<3>();
  Matrix6d by_marker = Matrix6d::Identity();
  by_marker.block<3, 3>(3, 0) = -skew(a.rotation * x.translation);
  out.jacobian.rightCols<3>() = -by_marker * marker.by_lens;
  out.residual = boxminus(a * x, y * eye.pose);
  out.noise = by_marker * marker.covariance * by_marker.transpose() +
              diagonal(options_.odometry_rad, options_.odometry_m);
  return out;
}

// A Kalman filter's update of a step and of its covariance. False: the pair lies outside of the gate; it is
// not used.
bool GlassesRegistration::update(const PairEquations& pair, Step* step, Covariance* covariance) {
  const Vector6d residual = pair.residual + pair.jacobian * *step;
  const Matrix6d innovation = pair.jacobian * *covariance * pair.jacobian.transpose() + pair.noise;
  const Eigen::LLT<Matrix6d> factor(innovation);
  if (residual.dot(factor.solve(residual)) > k_gate) return false;
  const Eigen::Matrix<double, k_size, 6> gain = factor.solve(pair.jacobian * *covariance).transpose();
  *step -= gain * residual;
  *covariance -= gain * innovation * gain.transpose();
  *covariance = 0.5 * (*covariance + covariance->transpose()).eval();
  return true;
}

void GlassesRegistration::move_by(const Step& step, Filter* filter) {
  filter->world_from_feed = boxplus(filter->world_from_feed, step.head<6>());
  filter->marker_from_eye = boxplus(filter->marker_from_eye, step.segment<6>(6));
  filter->delay_s += step[12];
  filter->lens += step.tail<3>();
}

// Updates the filter by one pair. False: the pair lies outside of the gate; it is not used.
bool GlassesRegistration::use_pair(const MeasuredMarker& marker, const Moving& eye, Filter* filter) const {
  predict_to(marker.at_s, eye.pose, filter);
  Step step = Step::Zero();
  if (!update(equations_at(*filter, marker, eye), &step, &filter->covariance)) return false;
  move_by(step, filter);
  return true;
}

// The filter after all of the first pairs, from a covariance that says next to nothing. The equations of all
// pairs are those at the prior's state, which is near the truth: the few first ones determine the state
// badly, and equations at what follows from them contradict the later ones.
GlassesRegistration::Filter GlassesRegistration::filtered(const Filter& prior, int* rejected) const {
  Filter filter = prior;
  filter.covariance.setZero();
  filter.covariance.block<6, 6>(0, 0) = filter.covariance.block<6, 6>(6, 6) =
      diagonal(k_start_rad, k_start_m);
  filter.covariance(12, 12) = k_start_delay_s * k_start_delay_s;
  filter.at_s = first_.front().at_s;
  *rejected = 0;
  Step step = Step::Zero();
  for (const MeasuredMarker& marker : first_) {
    const auto eye = eye_at(marker.at_s - clock_offset_s_ - filter.delay_s);
    if (eye) predict_to(marker.at_s, eye->pose, &filter);
    *rejected += !eye || !update(equations_at(filter, marker, *eye), &step, &filter.covariance);
  }
  move_by(step, &filter);
  return filter;
}

// Tries to start the filter from all pairs so far.
void GlassesRegistration::start_filter(double now_s) {
  while (!first_.empty() && first_.front().at_s < now_s - k_kept_s) first_.erase(first_.begin());
  problem_.clear();
  if (first_.size() < k_least_pairs) return;
  std::vector<tracker::TimedRotation> eyes, markers;
  for (const OdometryPose& eye : eyes_)
    eyes.push_back({eye.at_s + clock_offset_s_, eye.feed_from_eye.rotation});
  for (const MeasuredMarker& marker : first_)
    markers.push_back({marker.at_s, marker.world_from_marker.rotation});
  const auto delay = tracker::estimate_delay(tracker::turn_speeds(eyes), tracker::turn_speeds(markers));
  if (!delay) {
    problem_ = missing_motion();
    return;
  }
  // The first estimate needs no more than some of them.
  const std::size_t stride = 1 + first_.size() / k_first_pairs;
  std::vector<PosePair> pairs;
  const double middle_s = 0.5 * (first_.front().at_s + first_.back().at_s);
  for (std::size_t i = 0; i < first_.size(); i += stride) {
    const MeasuredMarker& marker = first_[i];
    const auto eye = eye_at(marker.at_s - clock_offset_s_ - delay->seconds);
    if (!eye) continue;
    const double age_s = std::abs(marker.at_s - middle_s);
    pairs.push_back({marker.world_from_marker, eye->pose, marker.covariance,
                     diagonal(options_.odometry_rad, options_.odometry_m) +
                         age_s * diagonal(options_.drift_rad, options_.drift_m)});
  }
  const auto solved = tracker::solve_hand_eye(pairs);
  if (!solved) {
    problem_ = missing_motion();
    return;
  }
  int rejected = 0;
  Filter filter = filtered({solved->world_from_feed, solved->body_from_sensor, delay->seconds}, &rejected);
  filter = filtered(filter, &rejected);
  const auto count = static_cast<int>(first_.size());
  if (solved->normalised_rms > k_worst_fit || 3 * rejected > count) {
    problem_ = fmt::format("Marker {} does not move as these glasses do. Is it on another pair?", marker_);
    return;
  }
  filter_ = filter;
  used_ += count - rejected;
  left_out_ += rejected;
  accepted_since_start_ = count - rejected;
  turned_rad_ = k_trusted_turn;
  rejected_in_turn_ = 0;
  first_.clear();
}

// The odometry has jumped: what the pair says, with the marker's place on the glasses that is known.
void GlassesRegistration::restart_feed(const MeasuredMarker& marker, const Pose& feed_from_eye) {
  const Pose world_from_eye = marker.world_from_marker * filter_->marker_from_eye;
  filter_->world_from_feed = world_from_eye * feed_from_eye.inverse();
  auto& covariance = filter_->covariance;
  covariance.topRows<6>().setZero();
  covariance.leftCols<6>().setZero();
  const Matrix6d wide = diagonal(k_start_rad, k_start_m);
  covariance.topLeftCorner<6, 6>() = drift_about(world_from_eye.translation, filter_->world_from_feed, wide);
  filter_->at_s = marker.at_s;
  accepted_since_start_ = rejected_in_turn_ = 0;
  started_facing_ = feed_from_eye.rotation;
  turned_rad_ = 0;
  is_feed_new_ = false;
}

// Uses the pairs that are complete: those with poses before and after the marker's moment.
void GlassesRegistration::continue_filter() {
  while (!markers_.empty()) {
    const MeasuredMarker marker = markers_.front();
    const double delay_s = filter_ ? filter_->delay_s : 0;
    const double page_s = marker.at_s - clock_offset_s_ - delay_s;
    const bool is_complete = eyes_.size() >= 2 && eyes_[eyes_.size() - 2].at_s >= page_s;
    // Without a filter the delay is not known: then the poses need not be there yet.
    if (!is_complete && filter_) return;
    const auto eye = filter_ ? eye_at(page_s) : std::nullopt;
    const Pose pose = eye ? eye->pose : eyes_.empty() ? Pose() : eyes_.back().feed_from_eye;
    markers_.pop_front();
    if (eyes_.empty() || !is_new_place(marker, pose)) continue;
    if (filter_ && !eye) continue;
    last_marker_ = marker;
    last_eye_ = pose;
    if (!filter_) {
      first_.push_back(marker);
      if (first_.size() > k_most_pairs) first_.erase(first_.begin());
      continue;
    }
    if (!continue_with(marker, *eye)) return;
  }
}

// Updates the filter by one pair. False: it was dropped, since the pairs contradict it.
bool GlassesRegistration::continue_with(const MeasuredMarker& marker, const Moving& eye) {
  if (is_feed_new_) restart_feed(marker, eye.pose);
  const bool is_used = use_pair(marker, eye, &*filter_);
  rejected_in_turn_ = is_used ? 0 : rejected_in_turn_ + 1;
  ++(is_used ? used_ : left_out_);
  accepted_since_start_ += is_used;
  if (is_used) turned_rad_ = std::max(turned_rad_, angle_between(started_facing_, eye.pose.rotation));
  if (rejected_in_turn_ < k_contradicted_after) return true;
  // The marker sits elsewhere on the glasses now, or on others; or the first view was wrong.
  filter_.reset();
  first_.clear();
  last_marker_.reset();
  return false;
}

GlassesPlace GlassesRegistration::place_of(const Filter& filter, double now_s) const {
  Filter now = filter;
  const Pose eye = eyes_.empty() ? Pose() : eyes_.back().feed_from_eye;
  predict_to(now_s, eye, &now);
  GlassesPlace place{now.world_from_feed, now.covariance.topLeftCorner<6, 6>(), now.marker_from_eye};
  place.delay_s = clock_offset_s_ + now.delay_s;
  place.delay_stddev_s = std::sqrt(std::max(0.0, now.covariance(12, 12)));
  Eigen::Matrix<double, 3, 6> at_eye;
  at_eye << -skew(now.world_from_feed.rotation * eye.translation), Matrix3d::Identity();
  place.eye_stddev_m = largest_deviation(at_eye * place.covariance * at_eye.transpose());
  place.eye_stddev_rad = largest_deviation(place.covariance.topLeftCorner<3, 3>());
  return place;
}

// Which rotation of the head is missing, by the odometry's own poses. The eye looks along -z, y is up.
std::string GlassesRegistration::missing_motion() const {
  const double since_s = first_.empty() ? 0 : first_.front().at_s - clock_offset_s_;
  Vector3d sum = Vector3d::Zero(), squares = Vector3d::Zero();
  double count = 1e-9;
  for (const OdometryPose& eye : eyes_) {
    if (first_.empty() || eye.at_s < since_s) continue;  // the marker was not seen then
    const Vector3d w =
        log_rotation(eyes_.front().feed_from_eye.rotation.conjugate() * eye.feed_from_eye.rotation);
    sum += w;
    squares += w.cwiseAbs2();
    ++count;
  }
  const Vector3d spread = (squares / count - (sum / count).cwiseAbs2()).cwiseMax(0).cwiseSqrt();
  const auto words = [&](const char* what, double found) {
    return fmt::format("{} (so far {:.0f} of {:.0f} degrees to each side).", what, 1.4 * found / k_degree,
                       1.4 * k_wanted_turn / k_degree);
  };
  if (spread.y() < k_wanted_turn) return words("Turn your head left and right", spread.y());
  if (spread.x() < k_wanted_turn) return words("Nod your head up and down", spread.x());
  return "Keep looking round, so that the room's cameras see the marker from more sides.";
}

std::string GlassesRegistration::unseen_advice() const {
  if (!options_.by_camera)
    return fmt::format("No camera of the room sees the marker {} on the glasses. Turn to a camera.", marker_);
  return view_problem_.empty() ? "The glasses' camera has shown no markers yet. Look at the prototype."
                               : view_problem_;
}

void GlassesRegistration::decide_state(double now_s) {
  const bool was_registered = state_ == GlassesState::registered;
  place_.reset();
  const bool is_silent = eyes_.empty() || now_s - eyes_.back().received_at_s > k_silent_s;
  const bool is_unseen = !marker_seen_s_ || now_s - *marker_seen_s_ > k_unseen_s;
  if (is_asleep_) {
    state_ = GlassesState::asleep;
    advice_ = "The glasses sleep. Put them on, or open the page again.";
  } else if (is_suspended_ || is_silent) {
    state_ = GlassesState::lost;
    advice_ = is_suspended_ ? "The glasses have lost their tracking. Look round slowly, in good light."
                            : "No poses arrive from the glasses. Is the page still open?";
  } else {
    advice_ = is_unseen           ? unseen_advice()
              : !problem_.empty() ? problem_
              : options_.by_camera
                  ? "Look round at the prototype, so that its markers are seen from more sides."
                  : missing_motion();
    if (filter_ && !is_feed_new_ && (options_.by_camera || turned_rad_ >= k_trusted_turn) &&
        accepted_since_start_ >= k_trusted_after) {
      const GlassesPlace place = place_of(*filter_, now_s);
      const double most_m = was_registered ? options_.give_up_m : options_.use_m;
      const double most_rad = was_registered ? options_.give_up_rad : options_.use_rad;
      if (place.eye_stddev_m <= most_m && place.eye_stddev_rad <= most_rad) {
        place_ = place;
        state_ = GlassesState::registered;
        advice_.clear();
        return;
      }
      if (was_registered && !is_unseen) advice_ = "The registration has become inaccurate. Look round.";
    }
    state_ = is_unseen && !filter_ ? GlassesState::waiting : GlassesState::looking_round;
  }
}

void GlassesRegistration::update(double now_s) {
  if (!is_suspended_) continue_filter();
  if (!options_.by_camera && !filter_ && now_s - last_start_s_ >= k_start_interval_s) {
    last_start_s_ = now_s;
    start_filter(now_s);
  }
  decide_state(now_s);
}

std::optional<Pose> GlassesRegistration::world_from_eye() const {
  if (!place_ || eyes_.empty()) return std::nullopt;
  return place_->world_from_feed * eyes_.back().feed_from_eye;
}

}  // namespace limn::remote
