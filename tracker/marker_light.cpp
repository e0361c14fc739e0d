#include "tracker/marker_light.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/names.h"
#include "core/result.h"

namespace limn::tracker {
namespace {

// A side is straight in the world but not in a distorted image, so it is drawn as this many pieces.
constexpr int k_pieces = 6;
constexpr int k_fraction_bits = 4;

// Standard deviation of the marker's place in its least certain direction, metres.
double place_deviation(const Track& track, const Pose& body_from_marker) {
  const Eigen::Vector3d d = track.world_from_body.rotation * body_from_marker.translation;
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << 0, d.z(), -d.y(), 1, 0, 0,  //
      -d.z(), 0, d.x(), 0, 1, 0,         //
      d.y(), -d.x(), 0, 0, 0, 1;
  const Eigen::Matrix3d covariance = by_pose * track.covariance * by_pose.transpose();
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues()[2]));
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
      const auto px = projector.project(world_from_marker * Eigen::Vector3d(p.x(), p.y(), 0));
      // Far outside the image nothing is drawn, and OpenCV's fixed-point numbers would overflow.
      if (!px || px->cwiseAbs().maxCoeff() > 1e5) return {};
      points.emplace_back(static_cast<int>(std::lround(px->x() * (1 << k_fraction_bits))),
                          static_cast<int>(std::lround(px->y() * (1 << k_fraction_bits))));
    }
  return points;
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
                           options.deviations * place_deviation(track, marker.body_from_marker);
      const auto points = contour(projector, world_from_marker, reach);
      if (!points.empty())
        cv::fillPoly(mask, std::vector{points}, cv::Scalar(255), cv::LINE_8, k_fraction_bits);
    }
  }
  return mask;
}

cv::Mat with_marker_light(const cv::Mat& image, const cv::Mat& mask, MarkerLight how) {
  LIMN_CHECK(image.size() == mask.size());
  cv::Mat out = image.clone();
  if (how == MarkerLight::keep_out) out.setTo(cv::Scalar::all(0), mask);
  if (how == MarkerLight::spotlight) out.setTo(cv::Scalar::all(255), mask);
  return out;
}

}  // namespace limn::tracker
