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

namespace limn::validate {

/// A person's hand in a projector's light, modelled as a sheet that faces the projector.
struct Hand {
  std::size_t projector = 0;
  double at = 0.6;  ///< Position as a share of the way from the projector to p_target.
  double width_m = 0.09, height_m = 0.18;
  Eigen::Vector3d p_target = Eigen::Vector3d::Zero();  ///< Point of the prototype that the blocked light is
                                                       ///< aimed at, prototype frame.
  double step_m = 0.025;                               ///< Distance between two frames while it moves.
};

/// One frame of a session with a hand in the light, as the ray tracer measures it.
struct ShadowFillFrame {
  std::string phase;        ///< "still", "stays", "moves", "gone"
  double share = 1;         ///< Filled share of the lost light that other projectors can give.
  double flash = 0;         ///< Light above that without the hand, as a share of it, in the worst pixel.
  double image_change = 0;  ///< Largest change in levels of the projectors' images from those without a hand.
};

struct ShadowFillReading {
  double share = 1;         ///< Smallest share from the fourth frame of a shadow on.
  double flash = 0;         ///< Largest over all frames.
  double still_levels = 0;  ///< Largest change of the projectors' images over 30 frames without a hand.
  double back_levels = 0;   ///< The same, from four frames after the hand has gone.
  std::vector<ShadowFillFrame> frames;
  cv::Mat before, lost, refilled;  ///< From the viewpoint, linear light (CV_32FC3).
};

/// Plays a session on the virtual rig: a renderer and a session's ShadowWatch in a loop with every camera's
/// noisy frames of `world`. What is shown is seen by the cameras one frame later. The phases are: 30 frames
/// without a hand; the hand suddenly there; staying; moving; suddenly gone. Only the projectors' light on the
/// prototype in the viewer's image counts. Error when the hand shades nothing that other projectors could
/// light.
Result<ShadowFillReading> measure_shadow_fill(const sim::World& world,
                                              const scene::Scene& scene,
                                              const scene::PosedScene& posed,
                                              const Imager& viewer,
                                              const Hand& hand,
                                              std::uint64_t seed);

}  // namespace limn::validate
