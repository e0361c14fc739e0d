#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>

#include "projector/renderer.h"
#include "scene/posed_scene.h"

namespace limn::exchange {

/// The points that one projector reaches, and how its light is blended.
struct ProjectorMaps {
  cv::Mat points;           ///< Renderer::surface_points
  cv::Mat blend;            ///< Renderer::blend
  int lit = 0, shared = 0;  ///< Pixels that reach the prototype; pixels that share it with other projectors.
  double most_lift = 0;     ///< Largest lift of black, as a share of white.
};

ProjectorMaps projector_maps(projector::Renderer* renderer,
                             std::size_t index,
                             const scene::PosedScene& posed);

}  // namespace limn::exchange
