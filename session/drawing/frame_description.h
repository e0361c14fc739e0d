#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/imager.h"
#include "core/marker.h"
#include "core/track.h"
#include "projector/overlays/overlays.h"
#include "scene/deviation_layer.h"
#include "scene/posed_scene.h"

namespace limn::session {

/// A part whose marker was lost and that is fading out.
struct FadingPart {
  scene::PosedPart part;
  double share = 0;  ///< the share of its light that is left, 0 … 1
};

/// The whole scene after its prototype was lost.
struct FadingScene {
  scene::PosedScene posed;
  double share = 0;
};

/// Everything that a frame's projector images depend on besides scene, rig and DrawOptions. Equal
/// descriptions give equal images, on every machine with the same OpenGL driver. World frame.
struct FrameDescription {
  std::uint64_t number = 0;  ///< counts the frames that a host has sent to its nodes
  Stamp painted_at, shown_at;
  std::vector<Track> tracks = {};  ///< predicted to shown_at; of bodies and of loose markers
  scene::PosedScene posed = {};    ///< the scene posed by the tracks and the show state
  Imager viewer = {};              ///< an imager at the viewpoint that `view` parts are drawn for
  std::vector<FadingPart> fading = {};
  std::vector<FadingScene> gone = {};               ///< none or one
  std::vector<projector::Overlay> on_surface = {};  ///< under the light that markers get
  std::vector<projector::Overlay> signs = {};       ///< over it
  std::vector<MarkerName> loose = {};               ///< loose markers, which get no light either
  /// What PosedScene::deviation names; null: nothing.
  std::shared_ptr<const scene::DeviationLayer> deviation = {};
  bool is_black = false;  ///< no light at all
  /// Whether the images differ from those before in more than lines; they are then drawn with fewer samples
  /// (Renderer::set_quick_motion). Changed lines are drawn soon without that.
  bool is_moving = false;
  /// The share of each projector's light that arrives (Renderer::set_occlusion), CV_8UC1, in the rig's order;
  /// empty ones, or no entries: all of it.
  std::vector<cv::Mat> arriving = {};
};

}  // namespace limn::session
