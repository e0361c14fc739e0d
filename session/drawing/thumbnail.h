#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "projector/renderer.h"
#include "scene/scene.h"

namespace limn::session {

/// Renders a variant alone, seen in front of its marker from a little above and to the right, so that it
/// fills `side_px` x `side_px` pixels; sRGB BGR on a dark background. `renderer` must be made for `scene`,
/// and its GL context must be current. Empty: the scene has no such variant.
cv::Mat draw_thumbnail(projector::Renderer* renderer,
                       const scene::Scene& scene,
                       const std::string& slot,
                       const std::string& variant,
                       int side_px);

}  // namespace limn::session
