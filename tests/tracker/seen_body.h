#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/marker.h"
#include "tracker/detection.h"
#include "tracker/marker_pose.h"

namespace limn::test {

/// A camera at the world's origin; 40 mm are 64 px at 1 m.
inline Imager camera_1080p() {
  return {"camera0", 1920, 1080, Lens::pinhole(1600, 1600, 959.5, 539.5), Pose{}};
}

/// `count` markers of 40 mm, 200 mm apart in a square, slightly tilted against each other; one is at the
/// origin.
inline Body body_of(int count) {
  Body body{"prototype", {}};
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p(i % 2 ? 0.1 : -0.1, i / 2 ? 0.1 : -0.1, 0);
    body.markers.push_back(
        {{"aruco_4x4_50", std::to_string(i)},
         0.04,
         Pose(exp_rotation({0.1 * (i % 2), 0.1 * (i / 2), 0}), count == 1 ? Eigen::Vector3d(0, 0, 0) : p)});
  }
  return body;
}

/// What a detector would find of the body: true corners with Gaussian noise, with the covariance of that
/// noise.
inline std::vector<tracker::Detection> detections_of(const Body& body,
                                                     const Imager& camera,
                                                     const Pose& world_from_body,
                                                     double noise_px,
                                                     std::mt19937_64& rng) {
  std::normal_distribution<double> noise(0, noise_px);
  std::vector<tracker::Detection> found;
  for (const BodyMarker& marker : body.markers) {
    tracker::Detection detection;
    detection.marker = marker.marker;
    detection.score = 1;
    const auto corners = tracker::square_corners(marker.size_m);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto px = camera.project(world_from_body * (marker.body_from_marker * corners[i]));
      detection.corners_px[i] = px.value() + Eigen::Vector2d(noise(rng), noise(rng));
      detection.corner_covariance[i] = noise_px * noise_px * Eigen::Matrix2d::Identity();
    }
    found.push_back(detection);
  }
  return found;
}

/// A hand that moves a body around a place: 0.25 m/s and 0.5 rad/s RMS, along and about every axis with a
/// frequency of its own, 0.3 to 0.6 Hz.
class HandMotion {
 public:
  HandMotion(const Pose& about, std::mt19937_64& rng) : about_(about) {
    std::uniform_real_distribution<double> frequency(0.3, 0.6), phase(0, 2 * std::numbers::pi);
    for (int i = 0; i < 6; ++i) {
      rate_[i] = 2 * std::numbers::pi * frequency(rng);
      phase_[i] = phase(rng);
    }
    turn_ = 0.5 / std::sqrt(0.5 * rate_.head<3>().squaredNorm());
    shift_ = 0.25 / std::sqrt(0.5 * rate_.tail<3>().squaredNorm());
  }

  Pose at(double seconds) const {
    const Vector6d s = (seconds * rate_ + phase_).array().sin();
    return {exp_rotation(turn_ * s.head<3>()) * about_.rotation, about_.translation + shift_ * s.tail<3>()};
  }

 private:
  Pose about_;
  Vector6d rate_, phase_;
  double turn_ = 0, shift_ = 0;
};

}  // namespace limn::test
