#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"
#include "core/rig.h"
#include "exchange/mpcdi.h"
#include "exchange/projector_maps.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::exchange {

/// The file format of exported points; its names are also the files' extensions.
enum class WarpFormat { pfm, exr };
inline constexpr EnumNames<WarpFormat, 2> k_warp_formats{{"pfm", "exr"}};

struct ExportOptions {
  std::filesystem::path rig;
  std::filesystem::path scene;   ///< Empty if only camera files are written.
  std::filesystem::path poses;   ///< POSES.json with the pose of the prototype; empty likewise.
  std::filesystem::path viewer;  ///< For profile 3d and looks; empty: the scene's viewer.
  std::filesystem::path mpcdi;   ///< MPCDI archive to write; empty: none.
  MpcdiProfile profile = MpcdiProfile::shader_lamps;
  double gamma = 1;            ///< Gamma of the alpha maps: value = share ^ (1 / gamma).
  int bits = 16;               ///< Bits of the alpha and beta maps: 8 or 16.
  std::filesystem::path warp;  ///< Folder for warp-NAME.pfm or .exr; empty: none.
  WarpFormat format = WarpFormat::pfm;
  std::filesystem::path looks;   ///< Folder for look-SLOT-VARIANT.png; empty: none.
  std::filesystem::path opencv;  ///< Folder for NAME.yml, OpenCV's camera files; empty: none.
  std::filesystem::path ros;     ///< Folder for NAME.yaml, ROS's camera_info files; empty: none.
  std::filesystem::path kalibr;  ///< Kalibr's camchain to write; empty: none.
};

/// Everything that exporters read, with consistent poses.
struct ExportJob {
  Rig rig;
  scene::Scene scene;
  scene::PosedScene posed;
  std::optional<Imager> viewer;
  std::vector<ProjectorMaps> maps;  ///< One for each projector.
};

/// One kind of output of `limn export`. A new one needs a file of its own, a row in exporters(), its options
/// in ExportOptions and their help texts in the command line.
struct Exporter {
  std::string name;                            ///< Name of the option that asks for it: "mpcdi" is --mpcdi.
  std::string argument;                        ///< Argument of that option: FILE or DIR.
  std::filesystem::path ExportOptions::*path;  ///< Where it writes; empty: it is not asked for.
  Status (*check)(const ExportOptions& options);  ///< Checks the values of its options.
  bool (*needs_viewer)(const ExportOptions& options);
  bool needs_parts = false;     ///< At least one part must be placed.
  bool needs_prototype = true;  ///< Whether it needs scene, poses and maps; else it needs the rig alone.
  Status (*write)(const ExportJob& job, const ExportOptions& options);
  bool is_asked_for(const ExportOptions& options) const { return !(options.*path).empty(); }
};

const std::vector<Exporter>& exporters();

/// Wrong usage: an option has a wrong value or is missing, or no output is asked for.
Status check_export(const ExportOptions& options);

/// Whether an exporter is asked for that needs scene, poses and maps.
bool needs_prototype(const ExportOptions& options);

/// Rig, scene and viewer as loaded from the files; the maps are still empty. Where only camera files are
/// asked for, the rig alone. Error: something is missing that the exporters asked for need.
Result<ExportJob> load_export_job(const ExportOptions& options);

}  // namespace limn::exchange
