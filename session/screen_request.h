#pragma once

#include <opencv2/core/types.hpp>
#include <optional>

#include "core/stereo.h"
#include "core/wall.h"
#include "scene/show_state.h"

namespace limn::session {

/// What a screen needs an image of.
struct ScreenRequest {
  scene::Screen what = scene::Screen::rest;
  bool for_two_eyes = false;      ///< the screen shows an image to each eye
  std::optional<Wall> wall = {};  ///< the screen stands there and shows what the viewer sees through it
  cv::Size wall_pixels = {};      ///< the wall's size in pixels

  bool operator==(const ScreenRequest&) const = default;
};

/// A request and its answer; empty images where there is nothing to show.
struct ScreenImages {
  ScreenRequest request;
  EyeImages images;
};

}  // namespace limn::session
