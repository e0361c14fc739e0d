#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/marker.h"
#include "core/track.h"

namespace limn::tracker {

struct MarkerLightOptions {
  /// White paper around the black square that light must treat alike, as a share of its side. As wide as the
  /// printed margin; wider takes more from the parts.
  double margin = 0.125;
  /// By how many standard deviations of its place a marker's outline is widened: for one in motion,
  /// predicted.
  double deviations = 3;
};

/// Where a projector's light falls on markers: CV_8UC1 of its image, 255 on every marker's paper, 0
/// elsewhere. For every body that has a track which is not lost, the outlines of its markers that face the
/// projector, through the projector's lens. Whether something stands in between is not asked.
cv::Mat marker_mask(const Imager& projector,
                    std::span<const Body> bodies,
                    std::span<const Track> tracks,
                    const MarkerLightOptions& options = {});

/// How a projector's image treats markers.
enum class MarkerLight {
  as_is,     ///< parts are painted over them
  keep_out,  ///< no light: the room's own shows them
  spotlight  ///< even white: in a dark room the projector itself shows them
};

/// as-is, keep-out, spotlight: what people call them, in the order of MarkerLight.
const std::vector<std::string>& marker_light_names();
/// nullopt for another word.
std::optional<MarkerLight> marker_light_of(const std::string& name);

/// The image (8-bit, display values) with the markers of a mask treated so.
cv::Mat with_marker_light(const cv::Mat& image, const cv::Mat& mask, MarkerLight how);

}  // namespace limn::tracker
