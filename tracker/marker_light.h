#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/constellation.h"
#include "core/enum_names.h"
#include "core/imager.h"
#include "core/marker.h"
#include "core/track.h"

namespace limn::tracker {

struct MarkerLightOptions {
  /// Width of the white margin around the black square that is treated like the square, as a share of its
  /// side. It should be the printed margin; a wider one takes more light from the parts.
  double margin = 0.125;
  /// A marker's outline is widened by this many standard deviations of its place, for markers in motion whose
  /// place is predicted.
  double deviations = 3;
};

/// Where a projector's light falls on markers: a CV_8UC1 mask of its image, 255 on every marker's paper, 0
/// elsewhere. It holds the outlines of the markers that face the projector, through the projector's lens, for
/// every body with a track that is not lost. Occlusion is ignored.
cv::Mat marker_mask(const Imager& projector,
                    std::span<const Body> bodies,
                    std::span<const Track> tracks,
                    const MarkerLightOptions& options = {});

/// The same for balls: their outlines, widened by `margin` of their diameter and by `deviations`.
cv::Mat ball_mask(const Imager& projector,
                  std::span<const Constellation> constellations,
                  std::span<const Track> tracks,
                  const MarkerLightOptions& options = {});

/// The tracks of those bodies of which the image of a camera for visible light can show a marker or a ball.
/// Projected light does not disturb the others: only cameras for infrared light see them.
std::vector<Track> seen_in_visible_light(std::span<const Imager> cameras,
                                         std::span<const Body> bodies,
                                         std::span<const Constellation> constellations,
                                         std::span<const Track> tracks);

/// How a projector's image treats markers.
enum class MarkerLight {
  as_is,     ///< parts are painted over them
  keep_out,  ///< no light: the room light shows them
  spotlight  ///< even white: in a dark room the projector itself makes them visible
};

/// Their names for users.
inline constexpr EnumNames<MarkerLight, 3> k_marker_lights{{"as-is", "keep-out", "spotlight"}};

/// The image (8-bit, display values) with that treatment of the markers in a mask.
cv::Mat with_marker_light(const cv::Mat& image, const cv::Mat& mask, MarkerLight how);

}  // namespace limn::tracker
