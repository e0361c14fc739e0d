#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>

#include "projector/renderer.h"
#include "scene/posed_scene.h"

namespace limn::apps {

/// What one projector lights and how its light is to be blended.
struct ProjectorMaps {
  cv::Mat points;           ///< Renderer::surface_points
  cv::Mat blend;            ///< Renderer::blend
  int lit = 0, shared = 0;  ///< pixels that light the prototype; that share their light with others
  double most_lift = 0;     ///< of black, as a share of white
};

ProjectorMaps projector_maps(projector::Renderer* renderer,
                             std::size_t index,
                             const scene::PosedScene& posed);

}  // namespace limn::apps
