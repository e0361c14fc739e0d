#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/compensation_options.h"
#include "core/result.h"

namespace limn::apps {

struct RenderOptions {
  std::filesystem::path rig;
  std::filesystem::path scene;
  std::vector<std::string> frames;  ///< CAMERA=PICTURE
  std::filesystem::path poses;      ///< POSES.json; places everything, frames are then only drawn over
  /// Viewer files; none: the scene's, else camera 0. Several share an eye (scene/viewpoint.h), that of one
  /// who has just come in.
  std::vector<std::filesystem::path> viewers;
  std::string composite = "full";  ///< or "rest": only what light cannot show
  bool undistorted = false;        ///< composites without the cameras' distortion
  std::string marker_light =
      "as-is";  ///< projectors leave markers dark ("keep-out") or light them ("spotlight")
  LightArguments light;
  std::string contact_shadow = "off";  ///< "on": parts darken the prototype around them, composites and view
  std::filesystem::path view;          ///< viewer file of a virtual camera: writes view.png
  std::optional<double> stereo_mm;     ///< base line: two eyes beside each other, view.png is twice as wide
  std::filesystem::path out;
};

/// `limn render`: places the scene by the markers in the frames, or by the poses, and writes
/// projector-NAME.png, composite-NAME.png (per camera with a frame; with poses alone per camera, over black),
/// coverage.json, mask-PART.png, view.png where one is asked for and, where light is balanced,
/// clipped-NAME.png of what it could not give (255: brighter, 128: darker).
Status run_render(const RenderOptions& options);

}  // namespace limn::apps
