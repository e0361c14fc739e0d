#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "calib/code/decode.h"
#include "core/imager.h"
#include "scene/meshes/scan_surface.h"

namespace limn::calib {

struct RangeOptions {
  /// Rays of camera and projector must meet within this many pixels, in addition to four standard deviations
  /// of the code. Raise it for a rig that is only roughly calibrated.
  double max_epipolar_px = 1.5;
  /// Minimum angle between the rays, degrees. Below it the distance is too uncertain.
  double min_angle_deg = 3;
  /// Surfaces seen more obliquely are rejected, and steps that would need such a surface are edges.
  double max_incidence_deg = 80;
  /// Points with a larger standard deviation, m, are rejected.
  double max_stddev_m = 2e-3;
  /// Half the side of the smoothing window on one smooth surface, camera pixels. A larger window gives less
  /// noise, but rounds details of that size.
  int smooth_px = 3;
  /// Standard deviation of a camera pixel's position: small, because the code is read at the pixel's centre
  /// and the lens is smooth.
  double camera_px = 0.02;
  /// Distances from the camera to keep, m.
  double nearest_m = 0, farthest_m = 1e9;
};

/// What happened to the decoded pixels.
struct RangeCounts {
  int decoded = 0;
  int epipolar = 0;   ///< rejected: camera and projector ray do not meet
  int angle = 0;      ///< rejected: rays almost parallel
  int unsure = 0;     ///< rejected: standard deviation, incidence or distance beyond the limits
  int conflicts = 0;  ///< rejected: two projectors disagree
  int edges = 0;      ///< rejected: on a depth edge, mixing both sides
  int kept = 0;
  double epipolar_rms_px = 0;     ///< over pixels that were not rejected by it
  double epipolar_median_px = 0;  ///< over all pixels
};

/// The measurement of one camera in one pose: the distance to the surface along each pixel's ray.
struct RangeView {
  Imager camera;
  std::vector<Eigen::Vector3f> d_camera;  ///< unit ray of every pixel, camera frame
  cv::Mat range;                          ///< CV_32F, m along the ray; NaN where there is none
  /// CV_32F, m: standard deviation of the range, from the code's noise and its correlation (without the rig's
  /// error).
  cv::Mat stddev;
  cv::Mat d_normal;  ///< CV_32FC3, world frame, unit, towards the camera
  cv::Mat links;     ///< CV_8U: bit 0: one surface with the pixel to the right; bit 1: with the one below
  RangeCounts counts;

  bool has(int x, int y) const;
  Eigen::Vector3d p_world(int x, int y) const;
};

/// A projector and what it showed this camera.
struct DecodedBy {
  const Imager* projector = nullptr;
  const Decoded* decoded = nullptr;
};

/// Triangulates every decoded pixel with each projector, combines the projectors' results by their variances,
/// cuts at depth edges, and fits a quadric to the inverse ranges around each pixel (from those that are on
/// one surface with it, weighted by variance and robustly): its centre is the range, its slope the normal.
/// The noise's true size and its correlation between neighbouring pixels are measured on the fits' and the
/// epipolar residuals, so that the standard deviations are right after averaging.
RangeView range_view(const Imager& camera, std::span<const DecodedBy> seen, const RangeOptions& options = {});

/// The surface that a view measured near a world point.
struct SurfaceSample {
  double offset = 0;  ///< from the point to the surface along d_normal, m
  double stddev = 0;  ///< standard deviation of the offset, m
  Eigen::Vector3d d_normal = Eigen::Vector3d::UnitZ();
};
/// nullopt where the view has no surface in that direction. Interpolates between pixels, if all four are on
/// one surface.
std::optional<SurfaceSample> surface_sample(const RangeView& view, const Eigen::Vector3d& p_world);

/// The view's pixels as points, neighbours on one surface joined by triangles.
scene::ScanSurface surface_of(const RangeView& view);

/// Removes the pixels where `keep` (CV_8U) is 0, and their links.
void restrict_to(const cv::Mat& keep, RangeView* view);

/// Connected components of the view by its links (CV_32S, from 1; 0: none), sorted by area, largest first;
/// `areas`: m².
cv::Mat connected_components(const RangeView& view, std::vector<double>* areas);

}  // namespace limn::calib
