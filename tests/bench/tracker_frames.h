#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/lens.h"
#include "tests/tracker/marker_images.h"

namespace limn::test {

enum class Light { even, gradient, steep_gradient, slats, projected };
/// A bright or a dark spot lies over the middle part of an edge and touches no cell of a 4x4 code.
enum class Cover { none, corner, edge, bite, bright_spot, dark_spot };

struct Range {
  double low = 0, high = 0;
};

/// What all frames of a series have in common. Values are drawn uniformly from their ranges.
struct Condition {
  std::string group, name;
  Range side_px = {60, 120};
  Range tilt_deg = {0, 50};
  Range blur_px = {0.4, 0.4};  ///< sigma of a Gaussian, in addition to the pixels' own area
  double motion_px = 0;        ///< length of a straight uniform motion during the exposure, in any direction
  double black = 30, white = 210;
  Light light = Light::even;
  double margin = 0.125;   ///< white paper around the marker, as share of its side
  bool dark_card = false;  ///< the paper lies on a dark square card, the card on light ground
  Cover cover = Cover::none;
  double cover_share = 0;      ///< width of the covering object, as share of the side
  double bow = 0;              ///< bent paper, as PlacedMarker::bow
  double cylinder_radius = 0;  ///< as PlacedMarker::cylinder_radius
  double row_motion_px = 0;    ///< rolling shutter: motion over 1000 rows, in any direction
  bool bent_lens = false;
  int jpeg_quality = 0;  ///< 0: none
  double noise_levels = 2;
  double background = -1;   ///< grey level beside the paper; negative: between black and white
  std::string family = {};  ///< empty: tracker_frame_families()
};

/// The conditions of the tracker's benchmark, ordered by group.
std::vector<Condition> tracker_conditions();

struct TrueMarker {
  MarkerName marker;
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<bool, 4> corner_covered{};
  Pose camera_from_marker;
};

/// An image with its ground truth.
struct TrackerFrame {
  cv::Mat grey;
  Lens lens;
  double marker_size_m = 0;
  std::vector<TrueMarker> markers;
};

/// The markers of all frames come from these families, in turn.
std::vector<std::string> tracker_frame_families();

/// A frame of 1280x960 pixels with 12 markers. Every other frame has a cluttered background. The same
/// arguments give the same frame.
TrackerFrame tracker_frame(const Condition& condition, std::uint64_t seed, int number);
/// The same, with markers drawn from these names.
TrackerFrame tracker_frame(const Condition& condition,
                           std::uint64_t seed,
                           int number,
                           std::span<const MarkerName> names);

/// A cluttered frame of this size with 12 ordinary markers of one family, for timing.
TrackerFrame cluttered_frame(int width, int height, std::uint64_t seed);

}  // namespace limn::test
