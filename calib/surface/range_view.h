#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "calib/code/decode.h"
#include "core/imager.h"
#include "scene/scan_surface.h"

namespace limn::calib {

struct RangeOptions {
  /// Rays of camera and projector must meet within this many pixels, beyond four standard deviations of the
  /// code. Raise for a rig that is only roughly calibrated.
  double max_epipolar_px = 1.5;
  /// Rays that meet at less, degrees, say little about the distance.
  double min_angle_deg = 3;
  /// Surfaces seen more obliquely are left out, and steps that would need such a surface are edges.
  double max_incidence_deg = 80;
  /// Points with a larger standard deviation, m, are left out.
  double max_stddev_m = 2e-3;
  /// Half the side of the window that averages a place with its neighbours on the same smooth surface, camera
  /// pixels. Larger is calmer, and rounds details of that size.
  int smooth_px = 3;
  /// Of a camera pixel's place, standard deviation: the code is read at the pixel's centre, the lens is
  /// smooth.
  double camera_px = 0.02;
  /// Distances from the camera to keep, m.
  double nearest_m = 0, farthest_m = 1e9;
};

/// What became of the decoded pixels.
struct RangeCounts {
  int decoded = 0;
  int epipolar = 0;   ///< rejected: camera and projector ray pass each other
  int angle = 0;      ///< rejected: rays all but parallel
  int unsure = 0;     ///< rejected: standard deviation, incidence or distance beyond the limits
  int conflicts = 0;  ///< rejected: two projectors disagree
  int edges = 0;      ///< rejected: on a depth edge, part of both sides
  int kept = 0;
  double epipolar_rms_px = 0;     ///< over what was not rejected by it
  double epipolar_median_px = 0;  ///< over everything
};

/// What one camera measured from where it stands: along each pixel's ray the distance to the surface.
struct RangeView {
  Imager camera;
  std::vector<Eigen::Vector3f> d_camera;  ///< unit ray of every pixel, camera frame
  cv::Mat range;                          ///< CV_32F, m along the ray; NaN where there is none
  cv::Mat
      stddev;  ///< CV_32F, m, of the range, from the code's noise and its correlation (not the rig's error)
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

/// Triangulates every decoded pixel with each projector, puts the projectors' answers together by their
/// variances, cuts at depth edges, and fits a quadric to the inverse ranges around each pixel (those that are
/// on one surface with it, weighted by variance, outliers in them losing weight): its middle is the range,
/// its slope the normal. The noise's true size and its correlation between neighbouring pixels are measured
/// on the fits' residuals, so that the standard deviations hold after averaging.
RangeView range_view(const Imager& camera, std::span<const DecodedBy> seen, const RangeOptions& options = {});

/// How a view sees the surface at a world point.
struct SurfaceSample {
  double offset = 0;  ///< from the point to the surface along d_normal, m
  double stddev = 0;  ///< of the offset, m
  Eigen::Vector3d d_normal = Eigen::Vector3d::UnitZ();
};
/// nullopt where the view has no surface in that direction (between its pixels: all four on one surface).
std::optional<SurfaceSample> surface_sample(const RangeView& view, const Eigen::Vector3d& p_world);

/// The view's pixels as points, neighbours on one surface joined by triangles.
scene::ScanSurface surface_of(const RangeView& view);

/// Forgets the pixels where `keep` (CV_8U) is 0, and their links.
void restrict_to(const cv::Mat& keep, RangeView* view);

/// Connected pieces of the view by its links (CV_32S, from 1; 0: nothing), the one with the largest area
/// first; `areas`: m².
cv::Mat connected_components(const RangeView& view, std::vector<double>* areas);

}  // namespace limn::calib
