#include "projector/stereo_cameras.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace limn::projector {
namespace {

constexpr double k_deg = std::numbers::pi / 180;
constexpr double k_shortest_m = 5e-3;
constexpr double k_from_rows = 30 * k_deg, k_between_axes = 40 * k_deg;
// Distance of the screen's plane where the axes tell none, and its limits, m.
constexpr double k_plane_m = 2, k_nearest_plane_m = 0.2, k_farthest_plane_m = 20;

Eigen::Vector3d axis(const Imager& imager, int which) {
  return imager.imager_from_world.rotation.conjugate() * Eigen::Vector3d::Unit(which);
}
Eigen::Vector3d centre(const Imager& imager) { return imager.imager_from_world.inverse().translation; }

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0));
}

bool is_pair(const Imager& left, const Imager& right) {
  if (left.sees != Spectrum::visible || right.sees != Spectrum::visible) return false;
  const Eigen::Vector3d base = centre(right) - centre(left);
  return base.norm() > k_shortest_m && angle(base, axis(left, 0)) < k_from_rows &&
         angle(base, axis(right, 0)) < k_from_rows && angle(axis(left, 2), axis(right, 2)) < k_between_axes;
}

// How far before the left camera the two axes pass each other.
double plane_m(const Imager& left, const Imager& right) {
  const Eigen::Vector3d a = axis(left, 2), b = axis(right, 2), base = centre(right) - centre(left);
  const double cosine = a.dot(b), sine2 = 1 - cosine * cosine;
  const double distance = sine2 > 1e-8 ? (base.dot(a) - cosine * base.dot(b)) / sine2 : k_plane_m;
  return distance > 0 ? std::clamp(distance, k_nearest_plane_m, k_farthest_plane_m) : k_plane_m;
}

Eigen::Matrix3d eyes_from_world(const Imager& left, const Imager& right) {
  const Eigen::Vector3d x = (centre(right) - centre(left)).normalized();
  const Eigen::Vector3d ahead = axis(left, 2) + axis(right, 2);
  const Eigen::Vector3d z = (ahead - ahead.dot(x) * x).normalized();
  Eigen::Matrix3d out;
  out << x.transpose(), z.cross(x).transpose(), z.transpose();
  return out;
}

// The pixel of the camera for each pixel of the eye; -1 where the camera sees nothing.
cv::Mat map_to(const Imager& camera, const Imager& eye) {
  const Pose camera_from_eye = camera.imager_from_world * eye.imager_from_world.inverse();
  cv::Mat map(eye.height, eye.width, CV_32FC2, cv::Scalar::all(-1));
  for (int row = 0; row < eye.height; ++row)
    for (int column = 0; column < eye.width; ++column) {
      const Eigen::Vector3d d((column - eye.lens.cx()) / eye.lens.fx(), (row - eye.lens.cy()) / eye.lens.fy(),
                              1);
      const auto px = camera.lens.project(camera_from_eye.rotation * d);
      if (px && camera.contains(*px))
        map.at<cv::Vec2f>(row, column) = {static_cast<float>(px->x()), static_cast<float>(px->y())};
    }
  return map;
}

}  // namespace

std::optional<StereoCameras> StereoCameras::chosen(const Rig& rig) {
  std::optional<StereoCameras> found;
  double shortest = 0;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i)
    for (std::size_t j = 0; j < rig.cameras.size(); ++j) {
      const double length = (centre(rig.cameras[j]) - centre(rig.cameras[i])).norm();
      if (i == j || !is_pair(rig.cameras[i], rig.cameras[j]) || (found && length >= shortest)) continue;
      found = StereoCameras();
      found->cameras_ = {i, j};
      shortest = length;
    }
  if (!found) return std::nullopt;
  const Imager &left = rig.cameras[found->cameras_[0]], &right = rig.cameras[found->cameras_[1]];
  const Eigen::Matrix3d rotation = eyes_from_world(left, right);
  const double focal = std::min({left.lens.fx(), left.lens.fy(), right.lens.fx(), right.lens.fy()});
  const double shift_px = focal * shortest / plane_m(left, right);  // between a point's columns
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const Imager& camera = rig.cameras[found->cameras_[eye]];
    Imager& to = found->eyes_[eye];
    to.name = camera.name;
    to.width = left.width;
    to.height = left.height;
    to.imager_from_world = Pose(rotation, -rotation * centre(camera));
    const double cx = 0.5 * (left.width - 1) + (eye == 0 ? -0.5 : 0.5) * shift_px;
    to.lens = Lens::pinhole(focal, focal, cx, 0.5 * (left.height - 1));
    found->maps_[eye] = map_to(camera, to);
  }
  return found;
}

EyeImages StereoCameras::rectified(const EyeImages& images) const {
  EyeImages out;
  cv::remap(images.left, out.left, maps_[0], cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  cv::remap(images.is_stereo() ? images.right : images.left, out.right, maps_[1], cv::noArray(),
            cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return out;
}

}  // namespace limn::projector
