#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <random>
#include <span>
#include <vector>

#include "core/lens.h"
#include "core/marker.h"
#include "core/pose.h"

namespace limn::test {

/// A marker to be drawn into an image.
struct PlacedMarker {
  MarkerName marker;
  Pose camera_from_marker;
  double size_m = 0.08;
  double margin = 0.125;  ///< white paper around what is printed, as share of the print's side
  /// How far the middles of its upper and lower sides lie below their chords, as share of its side: paper
  /// around a cylinder, seen along the cylinder's axis from above. The corners do not move.
  double bow = 0;
  /// Radius of the cylinder that the paper is wrapped around, in sides: its axis lies behind the paper, along
  /// the marker's y. 0: flat paper. The pose is that of the plane that touches the marker's middle.
  double cylinder_radius = 0;
  /// Rolling shutter: px by which the image moves from one row to the next; zero shift at the row of the
  /// marker's centre.
  Eigen::Vector2d row_motion = Eigen::Vector2d::Zero();
  /// Drawn instead of the marker's own cells, one pixel for each cell, if it is not empty.
  cv::Mat cells = {};
};

struct ImageOptions {
  double black = 30;        ///< grey level of ink
  double white = 210;       ///< grey level of paper
  double blur_px = 0;       ///< sigma of a Gaussian, in addition to the pixels' own area
  double noise_levels = 0;  ///< standard deviation of each pixel
};

/// The light of markers with exact truth, in grey levels, before blur and noise (CV_32FC1). Every pixel is
/// the mean over its area (coverage is sampled on a lattice where an edge crosses it), through the true lens,
/// with pixel centres at integers. `background` (8-bit grey) is visible beside the papers; later markers
/// cover earlier ones.
cv::Mat light_of(const Lens& lens,
                 const cv::Mat& background,
                 std::span<const PlacedMarker> markers,
                 const ImageOptions& options,
                 std::mt19937_64& rng);

/// Adds the noise, rounds and saturates.
cv::Mat noisy_grey(const cv::Mat& light, double noise_levels, std::mt19937_64& rng);

/// The camera's image of the scene: light, blur, noise.
cv::Mat image_of(const Lens& lens,
                 const cv::Mat& background,
                 std::span<const PlacedMarker> markers,
                 const ImageOptions& options,
                 std::mt19937_64& rng);

/// The corners' true pixels in the order of Detection::corners_px.
std::array<Eigen::Vector2d, 4> true_corners(const Lens& lens, const PlacedMarker& marker);

/// A marker whose centre projects to `px` and which would be `side_px` wide seen from straight ahead, turned
/// by `spin` about its own axis and tilted by `tilt` towards `tilt_direction` (radians).
PlacedMarker placed(const Lens& lens,
                    const MarkerName& marker,
                    const Eigen::Vector2d& px,
                    double side_px,
                    double spin,
                    double tilt,
                    double tilt_direction);

/// Shapes, stripes, dots, writing and gradients of all sizes: everything but markers.
cv::Mat clutter(int width, int height, std::mt19937_64& rng);

/// Hard for detectors: thousands of nested squares, all of which could be markers at first.
cv::Mat nested_squares(int width, int height);
/// Also hard: the same number of small squares that touch at their corners.
cv::Mat checkerboard(int width, int height, int square);
/// Every pixel has a random level.
cv::Mat noise(int width, int height, std::mt19937_64& rng);

/// Uniform grey.
cv::Mat plain(int width, int height, int grey);

}  // namespace limn::test
