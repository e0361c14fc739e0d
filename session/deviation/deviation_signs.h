#pragma once

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/pose.h"
#include "projector/overlays/overlays.h"
#include "scene/deviation_layer.h"

namespace limn::session {

/// The ring and the number of a place where the deviation is largest, in light.
struct DeviationSign {
  Pose prototype_from_mark;  ///< Its origin is the place, its z axis points into the surface, as a marker's.
  double size_m = 0;         ///< As the side of a marker that the ring goes around.
  cv::Mat image;             ///< The millimetres, CV_8UC3.
  std::optional<projector::OverlayPlace> place;  ///< None where numbers of larger deviations are.
};

/// The signs of a layer. They grow with the prototype, whose box is given; `d_up` is up in its frame.
std::vector<DeviationSign> deviation_signs(const scene::DeviationLayer& layer,
                                           const Eigen::AlignedBox3d& prototype_box,
                                           const Eigen::Vector3d& d_up);

/// The image with the colours' meaning in its lower left corner, and above it a warning where the shape did
/// not determine the alignment.
cv::Mat with_legend(const cv::Mat& image, const scene::DeviationLayer& layer, double tolerance_m);

}  // namespace limn::session
