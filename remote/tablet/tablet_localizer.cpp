#include "remote/tablet/tablet_localizer.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/median.h"
#include "core/names.h"
#include "remote/tablet/pose_by_lens.h"
#include "tracker/marker_pose.h"

namespace limn::remote {
namespace {

constexpr int k_lens_side = 1280;           // px, the longer side of the image size that lenses are kept for
constexpr std::size_t k_max_aspects = 4;    // aspect ratios of one device
constexpr double k_gate_px = 2;             // a marker was moved if its residual exceeds this
constexpr double k_gate_of_median = 4;      // multiple of the median residual
constexpr double k_min_chi_square_gap = 9;  // between a lone marker's pose and its mirrored one
constexpr double k_max_stddev_px = 8;       // pose error in the image at the markers' distance
constexpr double k_noticeable_px = 0.15;    // change of the lens anywhere in the image
constexpr double k_known_share = 0.03;      // focal length error below which the lens straightens sides
constexpr double k_better_share = 0.8;      // reduction of the standard deviation that is worth saving

using tracker::BodyCorrespondences;
using tracker::PoseFit;

// The markers of all bodies with a tracked pose, as one body in the world.
Body known_markers(std::span<const Body> bodies, std::span<const Track> tracks, std::size_t least_markers) {
  Body room{"room", {}};
  for (const Body& body : bodies)
    for (const Track& track : tracks) {
      if (track.body != body.name || track.tracking == TrackingState::lost ||
          body.markers.size() < least_markers)
        continue;
      for (const BodyMarker& marker : body.markers)
        room.markers.push_back(
            {marker.marker, marker.size_m, track.world_from_body * marker.body_from_marker});
    }
  return room;
}

// The RMS residual of a marker's corners, px.
double misfit(const tracker::MarkerCorrespondences& marker, const Pose& pose) {
  const auto chosen = tracker::corners_at({marker}, pose);
  double squares = 0;
  for (const tracker::PointObservation& observation : chosen.observations) {
    Eigen::Vector2d r;
    if (!tracker::residual(observation, pose, &r)) return 1e6;
    squares += r.squaredNorm();
  }
  return chosen.observations.empty() ? 1e6
                                     : std::sqrt(squares / static_cast<double>(chosen.observations.size()));
}

double gate_of(const BodyCorrespondences& corners, const Pose& pose) {
  std::vector<double> off;
  for (const tracker::MarkerCorrespondences& marker : corners) off.push_back(misfit(marker, pose));
  return std::max(k_gate_px, k_gate_of_median * median(std::move(off)));
}

BodyCorrespondences without_moved(const BodyCorrespondences& corners, const Pose& pose) {
  const double gate = gate_of(corners, pose);
  BodyCorrespondences kept;
  for (const tracker::MarkerCorrespondences& marker : corners)
    if (misfit(marker, pose) <= gate) kept.push_back(marker);
  return kept;
}

// The pose fitted from the last one, if there are enough markers and it fits them all. This is faster than a
// search from nothing.
std::optional<PoseFit> fitted_near(const BodyCorrespondences& corners, const std::optional<Pose>& last) {
  constexpr std::size_t k_enough = 4;
  constexpr double k_fits_px = 1;
  if (!last || corners.size() < k_enough) return std::nullopt;
  const auto fit =
      tracker::fit_pose(tracker::corners_at(corners, *last).observations, *last, tracker::k_huber);
  return fit && fit->rms_px < k_fits_px ? fit : std::nullopt;
}

// The standard deviation of the projected centre of the markers, px.
double position_stddev_px(const Imager& camera, const PoseFit& fit, const BodyCorrespondences& corners) {
  Eigen::Vector3d p_middle = Eigen::Vector3d::Zero();
  for (const tracker::MarkerCorrespondences& marker : corners)
    p_middle += marker.marker->body_from_marker.translation;
  p_middle /= static_cast<double>(corners.size());
  const tracker::PointObservation observation{&camera.lens, Pose(), p_middle, Eigen::Vector2d::Zero()};
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 6> d_r;
  if (!tracker::residual(observation, fit.world_from_body, &r, &d_r)) return 1e6;
  return std::sqrt((d_r * fit.covariance * d_r.transpose()).trace());
}

// The largest distance between the projections of two lenses, px of an image of this width.
double difference_px(const calib::IntrinsicsEstimate& a, const calib::IntrinsicsEstimate& b, int width) {
  constexpr int k_nodes = 7;
  const Lens lens_a = a.lens(), lens_b = b.lens();
  double most = 0;
  for (int i = 0; i < k_nodes * k_nodes; ++i) {
    const Eigen::Vector2d px(static_cast<double>(i % k_nodes) * (a.width - 1) / (k_nodes - 1),
                             static_cast<double>(i / k_nodes) * (a.height - 1) / (k_nodes - 1));
    const auto d = lens_a.unproject(px);
    const auto there = d ? lens_b.project(*d) : std::nullopt;
    most = std::max(most, there ? (*there - px).norm() : 1e6);
  }
  return most * width / a.width;
}

// New tracks of single markers that this image shows elsewhere than `tracks` says.
std::vector<Track> moved_markers(const Imager& view,
                                 double gate_px,
                                 std::span<const tracker::Detection> detections,
                                 std::span<const Body> bodies,
                                 std::span<const Track> tracks) {
  std::vector<Track> moved;
  Imager camera = view;
  camera.imager_from_world = Pose();
  const tracker::View here{&camera, detections};
  for (const Track& track : tracks) {
    const Body* body = find_named(bodies, track.body);
    if (!body || body->markers.size() != 1 || track.tracking == TrackingState::lost) continue;
    const BodyCorrespondences corners = tracker::correspondences(*body, std::span(&here, 1));
    const Pose expected = view.imager_from_world * track.world_from_body;
    if (corners.empty() || misfit(corners[0], expected) <= gate_px) continue;
    // Takes the one of two ambiguous poses whose rotation is nearer to the old track.
    std::optional<PoseFit> best;
    for (const PoseFit& fit : tracker::minima(corners))
      if (!best || angle_between(fit.world_from_body.rotation, expected.rotation) <
                       angle_between(best->world_from_body.rotation, expected.rotation))
        best = fit;
    if (!best) continue;
    const Pose world_from_camera = view.imager_from_world.inverse();
    Track there = track;
    there.world_from_body = world_from_camera * best->world_from_body;
    Matrix6d turn = Matrix6d::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = world_from_camera.rotation_matrix();
    there.covariance = turn * best->covariance * turn.transpose();
    there.tracking = TrackingState::measured;
    moved.push_back(there);
  }
  return moved;
}

}  // namespace

TabletLocalizer::TabletLocalizer(tracker::Families families,
                                 std::span<const calib::IntrinsicsEstimate> lenses)
    : detector_(std::move(families),
                {.encoding = tracker::Encoding::srgb, .broken_markers = false, .pattern_fits = false}) {
  for (const calib::IntrinsicsEstimate& lens : lenses)
    aspects_.push_back({calib::OnlineIntrinsics(lens), lens, lens.focal_stddev_px()});
}

TabletLocalizer::Aspect& TabletLocalizer::aspect_of(int width, int height) {
  const auto found = std::find_if(aspects_.begin(), aspects_.end(), [&](const Aspect& aspect) {
    return aspect.used.resized(width, height).has_value();
  });
  if (found != aspects_.end()) {
    std::rotate(found, found + 1, aspects_.end());
    return aspects_.back();
  }
  if (aspects_.size() >= k_max_aspects) aspects_.erase(aspects_.begin());
  const double scale = static_cast<double>(k_lens_side) / std::max(width, height);
  const calib::IntrinsicsEstimate lens =
      calib::prior_intrinsics(std::max(1, static_cast<int>(std::lround(scale * width))),
                              std::max(1, static_cast<int>(std::lround(scale * height))));
  aspects_.push_back({calib::OnlineIntrinsics(lens), lens, lens.focal_stddev_px()});
  return aspects_.back();
}

// Keeps the corners of each body with several markers for update_intrinsics(). Each body has a pose of its
// own there, so that errors of the session's tracks matter little.
void TabletLocalizer::collect_views(const Imager& camera,
                                    std::span<const tracker::Detection> detections,
                                    std::span<const Body> bodies,
                                    std::span<const Track> tracks) {
  Imager here = camera;
  here.imager_from_world = Pose();
  const tracker::View view{&here, detections};
  const calib::IntrinsicsEstimate& kept = aspects_.back().used;
  const Eigen::Vector2d scale(static_cast<double>(kept.width) / camera.width,
                              static_cast<double>(kept.height) / camera.height);
  for (const Body& body : bodies)
    for (const Track& track : tracks) {
      if (body.markers.size() < 2 || track.body != body.name) continue;
      const BodyCorrespondences corners = tracker::correspondences(body, std::span(&view, 1));
      if (corners.size() < 2) continue;
      calib::BodyView noted{camera.imager_from_world * track.world_from_body, {}};
      for (const tracker::PointObservation& observation :
           tracker::corners_at(corners, noted.camera_from_body).observations)
        noted.points.push_back(
            {observation.p_body, (scale.array() * (observation.px.array() + 0.5) - 0.5).matrix(),
             scale.asDiagonal() * Eigen::Matrix2d(observation.information.inverse()) * scale.asDiagonal()});
      views_.push_back(std::move(noted));
    }
}

TabletPose TabletLocalizer::localize(const cv::Mat& bgr,
                                     std::span<const Body> bodies,
                                     std::span<const Track> tracks) {
  cv::Mat grey;
  cv::cvtColor(bgr, grey, cv::COLOR_BGR2GRAY);
  views_.clear();
  width_ = grey.cols;
  const Aspect& aspect = aspect_of(grey.cols, grey.rows);
  const auto lens = aspect.used.resized(grey.cols, grey.rows);
  LIMN_CHECK(lens.has_value());
  Imager camera{"guest", grey.cols, grey.rows, lens->lens(), Pose()};
  const double focal_stddev_px =
      aspect.lens.estimate().focal_stddev_px() * grey.cols / static_cast<double>(aspect.used.width);
  const bool is_known = focal_stddev_px < k_known_share * lens->values[0];
  const std::vector<tracker::Detection> detections =
      detector_.detect(grey, is_known ? &camera.lens : nullptr);

  TabletPose out;
  out.focal_stddev_px = focal_stddev_px;
  out.lens_frames = aspect.lens.estimate().views;
  const auto without_pose = [&](const char* why) {
    out.why = why;
    return out;
  };
  if (detections.empty()) return without_pose("No markers in view: point the camera at the prototype.");
  const tracker::View view{&camera, detections};
  // Bodies with several markers have better poses than those with one.
  Body room = known_markers(bodies, tracks, 2);
  BodyCorrespondences corners = tracker::correspondences(room, std::span(&view, 1));
  if (corners.size() < 2) {
    room = known_markers(bodies, tracks, 1);
    corners = tracker::correspondences(room, std::span(&view, 1));
  }
  if (corners.empty())
    return without_pose("The markers in view have no known place: the room's camera must see them, too.");
  std::vector<PoseFit> fits;
  if (const auto near = fitted_near(corners, last_pose_)) fits = {*near};
  last_pose_.reset();
  if (fits.empty()) fits = tracker::minima(corners);
  constexpr const char* k_go_nearer = "The markers in view are too small or too steep: go nearer.";
  if (fits.empty()) return without_pose(k_go_nearer);
  PoseFit fit = fits.front();
  const BodyCorrespondences kept = without_moved(corners, fit.world_from_body);
  if (kept.size() < corners.size() && !kept.empty())
    if (const auto again = tracker::fit_pose(tracker::corners_at(kept, fit.world_from_body).observations,
                                             fit.world_from_body, tracker::k_huber))
      fit = *again;
  if (kept.size() < 2 && fits.size() > 1 && fits[1].chi_square - fits[0].chi_square < k_min_chi_square_gap)
    return without_pose("One marker alone does not tell the place for sure: bring a second one into view.");
  if (!(position_stddev_px(camera, fit, kept.empty() ? corners : kept) < k_max_stddev_px))
    return without_pose(k_go_nearer);
  out.markers = static_cast<int>(kept.size());
  out.rms_px = fit.rms_px;
  const std::vector<tracker::PointObservation> fitted =
      tracker::corners_at(kept.empty() ? corners : kept, fit.world_from_body).observations;
  const double freedom = std::max(1.0, 2.0 * static_cast<double>(fitted.size()) - 6);
  out.by_lens = pose_by_lens(fitted, fit);
  out.covariance = std::max(1.0, fit.chi_square / freedom) * fit.covariance;
  const double gate_px = gate_of(corners, fit.world_from_body);
  camera.imager_from_world = fit.world_from_body;  // `view` and `fit` had the camera at the origin
  out.moved = moved_markers(camera, gate_px, detections, bodies, tracks);
  collect_views(camera, detections, bodies, tracks);
  last_pose_ = camera.imager_from_world;
  out.view = std::move(camera);
  return out;
}

void TabletLocalizer::update_intrinsics() {
  if (aspects_.empty()) return;
  Aspect& aspect = aspects_.back();
  bool has_new_views = false;
  for (const calib::BodyView& view : views_) has_new_views |= aspect.lens.add(view);
  views_.clear();
  if (has_new_views) aspect.lens.improve();
  if (has_new_views && difference_px(aspect.lens.estimate(), aspect.used, width_) > k_noticeable_px)
    aspect.used = aspect.lens.estimate();
}

std::vector<calib::IntrinsicsEstimate> TabletLocalizer::lenses() const {
  std::vector<calib::IntrinsicsEstimate> out;
  for (const Aspect& aspect : aspects_)
    if (aspect.lens.estimate().views > 0) out.push_back(aspect.lens.estimate());
  return out;
}

bool TabletLocalizer::has_better_lenses() const {
  return std::any_of(aspects_.begin(), aspects_.end(), [](const Aspect& aspect) {
    const double now = aspect.lens.estimate().focal_stddev_px();
    return aspect.lens.estimate().views > 0 &&
           (now < k_better_share * aspect.saved_stddev_px || now > aspect.saved_stddev_px / k_better_share);
  });
}

void TabletLocalizer::mark_lenses_saved() {
  for (Aspect& aspect : aspects_) aspect.saved_stddev_px = aspect.lens.estimate().focal_stddev_px();
}

}  // namespace limn::remote
