#include "tracker/marker_light.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/names.h"
#include "core/result.h"

namespace limn::tracker {
namespace {

// A side is straight in the world but not in a distorted image, so it is drawn as this many pieces.
constexpr int k_pieces = 6;
constexpr int k_fraction_bits = 4;

// Standard deviation of a body's point in its least certain direction, metres.
double place_deviation(const Track& track, const Eigen::Vector3d& p_body) {
  const Eigen::Vector3d d = track.world_from_body.rotation * p_body;
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << 0, d.z(), -d.y(), 1, 0, 0,  //
      -d.z(), 0, d.x(), 0, 1, 0,         //
      d.y(), -d.x(), 0, 0, 0, 1;
  const Eigen::Matrix3d covariance = by_pose * track.covariance * by_pose.transpose();
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues()[2]));
}

// Adds the pixel of a point, as a number with fraction bits. False when it has none.
bool add_point(const Imager& projector, const Eigen::Vector3d& p_world, std::vector<cv::Point>* points) {
  const auto px = projector.project(p_world);
  // Far outside the image nothing is drawn, and OpenCV's fixed-point numbers would overflow.
  if (!px || px->cwiseAbs().maxCoeff() > 1e5) return false;
  points->emplace_back(static_cast<int>(std::lround(px->x() * (1 << k_fraction_bits))),
                       static_cast<int>(std::lround(px->y() * (1 << k_fraction_bits))));
  return true;
}

void fill(const std::vector<cv::Point>& contour, cv::Mat* mask) {
  if (!contour.empty())
    cv::fillPoly(*mask, std::vector{contour}, cv::Scalar(255), cv::LINE_8, k_fraction_bits);
}

// Outline of a square with half side `reach` around the marker's centre; empty when it is not completely in
// front.
std::vector<cv::Point> contour(const Imager& projector, const Pose& world_from_marker, double reach) {
  static const Eigen::Vector2d k_corners[] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  std::vector<cv::Point> points;
  for (int side = 0; side < 4; ++side)
    for (int i = 0; i < k_pieces; ++i) {
      const double t = static_cast<double>(i) / k_pieces;
      const Eigen::Vector2d p = reach * ((1 - t) * k_corners[side] + t * k_corners[(side + 1) % 4]);
      if (!add_point(projector, world_from_marker * Eigen::Vector3d(p.x(), p.y(), 0), &points)) return {};
    }
  return points;
}

// The outline of a sphere; empty when it is not completely in front.
std::vector<cv::Point> ball_contour(const Imager& projector, const Eigen::Vector3d& p_world, double radius) {
  constexpr int k_points = 32;
  const Pose world_from_projector = projector.imager_from_world.inverse();
  const Eigen::Vector3d away = p_world - world_from_projector.translation;
  const double distance = away.norm();
  if (!(distance > radius)) return {};
  // The rays that touch the sphere do so on a circle, a little nearer than its centre.
  const double sine = radius / distance, circle = radius * std::sqrt(1 - sine * sine);
  const Eigen::Vector3d d = away / distance, a = d.unitOrthogonal(), b = d.cross(a);
  std::vector<cv::Point> points;
  for (int i = 0; i < k_points; ++i) {
    const double turn = 2 * std::numbers::pi * i / k_points;
    const Eigen::Vector3d p =
        p_world - radius * sine * d + circle * (std::cos(turn) * a + std::sin(turn) * b);
    if (!add_point(projector, p, &points)) return {};
  }
  return points;
}

bool is_in_image(const Imager& camera, const Eigen::Vector3d& p_world) {
  const auto px = camera.project(p_world);
  return px && camera.contains(*px);
}

bool faces(const Imager& imager, const Pose& world_from_marker) {
  const Pose imager_from_marker = imager.imager_from_world * world_from_marker;
  return (imager_from_marker.rotation * Eigen::Vector3d::UnitZ()).dot(imager_from_marker.translation) > 0;
}

}  // namespace

cv::Mat marker_mask(const Imager& projector,
                    std::span<const Body> bodies,
                    std::span<const Track> tracks,
                    const MarkerLightOptions& options) {
  cv::Mat mask = cv::Mat::zeros(projector.height, projector.width, CV_8UC1);
  for (const Track& track : tracks) {
    const Body* body = find_named(bodies, track.body);
    if (!body || track.tracking == TrackingState::lost) continue;
    for (const BodyMarker& marker : body->markers) {
      const Pose world_from_marker = track.world_from_body * marker.body_from_marker;
      if (!faces(projector, world_from_marker)) continue;
      const double reach = (0.5 + options.margin) * marker.size_m +
                           options.deviations * place_deviation(track, marker.body_from_marker.translation);
      fill(contour(projector, world_from_marker, reach), &mask);
    }
  }
  return mask;
}

cv::Mat ball_mask(const Imager& projector,
                  std::span<const Constellation> constellations,
                  std::span<const Track> tracks,
                  const MarkerLightOptions& options) {
  cv::Mat mask = cv::Mat::zeros(projector.height, projector.width, CV_8UC1);
  for (const Track& track : tracks) {
    const Constellation* balls = find_named(constellations, track.body);
    if (!balls || track.tracking == TrackingState::lost) continue;
    for (const Eigen::Vector3d& p : balls->p_balls)
      fill(ball_contour(
               projector, track.world_from_body * p,
               (1 + 2 * options.margin) * balls->radius_m + options.deviations * place_deviation(track, p)),
           &mask);
  }
  return mask;
}

std::vector<Track> seen_in_visible_light(std::span<const Imager> cameras,
                                         std::span<const Body> bodies,
                                         std::span<const Constellation> constellations,
                                         std::span<const Track> tracks) {
  const auto is_seen = [&](const Eigen::Vector3d& p_world) {
    return std::ranges::any_of(cameras, [&](const Imager& camera) {
      return camera.sees == Spectrum::visible && is_in_image(camera, p_world);
    });
  };
  std::vector<Track> seen;
  std::ranges::copy_if(tracks, std::back_inserter(seen), [&](const Track& track) {
    const Body* body = find_named(bodies, track.body);
    const Constellation* balls = find_named(constellations, track.body);
    const auto shows_marker = [&](const BodyMarker& marker) {
      return is_seen(track.world_from_body * marker.body_from_marker.translation);
    };
    const auto shows_ball = [&](const Eigen::Vector3d& p) { return is_seen(track.world_from_body * p); };
    return (body && std::ranges::any_of(body->markers, shows_marker)) ||
           (balls && std::ranges::any_of(balls->p_balls, shows_ball));
  });
  return seen;
}

cv::Mat with_marker_light(const cv::Mat& image, const cv::Mat& mask, MarkerLight how) {
  LIMN_CHECK(image.size() == mask.size());
  cv::Mat out = image.clone();
  if (how == MarkerLight::keep_out) out.setTo(cv::Scalar::all(0), mask);
  if (how == MarkerLight::spotlight) out.setTo(cv::Scalar::all(255), mask);
  return out;
}

}  // namespace limn::tracker
