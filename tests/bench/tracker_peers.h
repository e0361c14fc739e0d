#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/lens.h"
#include "core/marker.h"

namespace limn::test {

/// A marker as one of the compared detectors found it, corners in any cyclic order, pixel centres at
/// integers.
struct Found {
  MarkerName marker;
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<Eigen::Matrix2d, 4> covariance;  ///< from Limn; identity for detectors that give none
};

struct Peer {
  std::string name;
  std::function<std::vector<Found>(const cv::Mat& grey, const Lens* lens)> detect;
};

/// Limn's detector. It uses `lens` where one is given.
Peer limn_peer(std::span<const std::string> families, int threads);
/// libapriltag at quad_decimate 1 or 2. It accepts only families named apriltag_36h11 and apriltag_25h9.
Peer apriltag_peer(std::span<const std::string> families, float decimate, int threads);
/// OpenCV aruco with sub-pixel corners, one pass for each family. It uses OpenCV's own threads
/// (cv::setNumThreads).
Peer opencv_peer(std::span<const std::string> families);

}  // namespace limn::test
