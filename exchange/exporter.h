#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "exchange/projector_maps.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

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
};

/// All that is exported, and how it stands to each other.
struct ExportJob {
  Rig rig;
  scene::Scene scene;
  scene::PosedScene posed;
  std::optional<Imager> viewer;
  std::vector<ProjectorMaps> maps;  ///< of each projector
};

/// One kind of output of `limn export`. Another one is a file of its own, a row of exporters(), its options
/// in ExportOptions and their words on the command line.
struct Exporter {
  std::string name;                               ///< of the option that asks for it: "mpcdi" is --mpcdi
  std::string argument;                           ///< of that option: FILE or DIR
  std::filesystem::path ExportOptions::*path;     ///< where it writes; empty: it is not asked for
  Status (*check)(const ExportOptions& options);  ///< its options' values
  bool (*needs_viewer)(const ExportOptions& options);
  bool needs_parts = false;  ///< at least one part must be placed
  Status (*write)(const ExportJob& job, const ExportOptions& options);
  bool is_asked_for(const ExportOptions& options) const { return !(options.*path).empty(); }
};

const std::vector<Exporter>& exporters();

/// Wrong usage: a wrong value of an option, or nothing is asked for.
Status check_export(const ExportOptions& options);

/// Rig, scene and viewer as the files have them, still without maps. Error: something is missing that the
/// wanted exporters need.
Result<ExportJob> load_export_job(const ExportOptions& options);

}  // namespace limn::apps
