#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"

namespace limn::apps {

struct ExportOptions {
  std::filesystem::path rig;
  std::filesystem::path scene;
  std::filesystem::path poses;   ///< POSES.json: where the prototype stands
  std::filesystem::path viewer;  ///< of profile 3d and looks; empty: the scene's
  std::filesystem::path mpcdi;   ///< archive to write
  std::string profile = "sl";    ///< or a3, 3d
  double gamma = 1;              ///< of alpha maps: value = share ^ (1 / gamma)
  int bits = 16;                 ///< of alpha and beta maps: 8 or 16
  std::filesystem::path warp;    ///< folder for warp-NAME.pfm or .exr
  std::string format = "pfm";    ///< or exr
  std::filesystem::path looks;   ///< folder for look-SLOT-VARIANT.png
  bool json = false;
};

/// `limn export`: warp and blend of every projector for other programs. At least one of `mpcdi`, `warp` and
/// `looks` is written. All points are in the frame of the prototype's mesh, in metres.
Status run_export(const ExportOptions& options);

}  // namespace limn::apps
