#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/compensation_options.h"
#include "core/enum_names.h"
#include "core/result.h"
#include "projector/renderer.h"
#include "tracker/marker_light.h"

namespace limn::apps {

/// The names of --composite.
inline constexpr EnumNames<projector::Composite, 2> k_composites{{"rest", "full"}};

struct RenderOptions {
  std::filesystem::path rig;
  std::filesystem::path scene;
  std::vector<std::string> frames;  ///< CAMERA=IMAGE
  std::filesystem::path poses;      ///< POSES.json that places everything; frames are then only drawn over.
  /// Viewer files; empty: the scene's viewers, or else camera 0. Several viewers share one viewpoint
  /// (scene/viewpoint.h), as if all had just arrived.
  std::vector<std::filesystem::path> viewers;
  projector::Composite composite = projector::Composite::full;
  bool undistorted = false;  ///< Composites without the cameras' lens distortion.
  tracker::MarkerLight marker_light = tracker::MarkerLight::as_is;
  LightArguments light;
  bool contact_shadow = false;      ///< Parts darken the prototype around them in composites and view.
  std::filesystem::path view;       ///< Viewer file of a virtual camera: writes view.png.
  std::optional<double> stereo_mm;  ///< Base line: two cameras side by side; view.png is twice as wide.
  std::filesystem::path out;
};

/// `limn render`: places the scene by the markers in the frames, or by the poses. Writes projector-NAME.png,
/// composite-NAME.png (for each camera with a frame; with poses alone for each camera, over black),
/// coverage.json, mask-PART.png, view.png if it is asked for and, if light is balanced, clipped-NAME.png:
/// where the projector could not give the wanted light (255: brighter was wanted, 128: darker).
Status run_render(const RenderOptions& options);

}  // namespace limn::apps
