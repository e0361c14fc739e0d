#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/result.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "sim/world.h"

namespace limn::apps {

/// Somebody's hand in a projector's light: a sheet that faces it.
struct Hand {
  std::size_t projector = 0;
  double at = 0.6;  ///< share of the way from the projector to the prototype's point that it points at
  double width_m = 0.09, height_m = 0.18;
  Eigen::Vector3d p_aim = Eigen::Vector3d::Zero();  ///< that point, prototype frame
  double step_m = 0.025;                            ///< of its way from frame to frame, while it moves
};

/// One frame of a session with a hand in it, as the ray tracer judges it.
struct ShadowFillFrame {
  std::string phase;        ///< "still", "stays", "moves", "gone"
  double share = 1;         ///< of the light lost to the shadow, where others can give it: what is back
  double flash = 0;         ///< light over what was there without the hand, as a share of it, worst pixel
  double image_change = 0;  ///< worst level of the projectors' images from those without a hand
};

struct ShadowFillReading {
  double share = 1;         ///< the least share from the fourth frame of a shadow on
  double flash = 0;         ///< the largest, over all frames
  double still_levels = 0;  ///< largest change of the projectors' images over 30 frames without a hand
  double back_levels = 0;   ///< the same, four frames after the hand has gone
  std::vector<ShadowFillFrame> frames;
  cv::Mat before, lost, refilled;  ///< from the viewer's eye, linear light (CV_32FC3)
};

/// Plays a session on the virtual rig: a renderer and a session's ShadowWatch in a loop with every camera's
/// noisy frames of `world`, one frame from light to light. 30 frames without a hand; the hand suddenly there,
/// staying, moving, suddenly gone. Light is what the projectors' light makes of the prototype in the viewer's
/// image. Error where the hand shades nothing that others could light.
Result<ShadowFillReading> measured_shadow_fill(const sim::World& world,
                                               const scene::Scene& scene,
                                               const scene::PosedScene& posed,
                                               const Imager& viewer,
                                               const Hand& hand,
                                               std::uint64_t seed);

}  // namespace limn::apps
