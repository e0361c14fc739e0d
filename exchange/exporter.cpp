#include "exchange/exporter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "exchange/camera_exporter.h"
#include "exchange/look_exporter.h"
#include "exchange/mpcdi_exporter.h"
#include "exchange/warp_exporter.h"

namespace limn::exchange {

const std::vector<Exporter>& exporters() {
  static const std::vector<Exporter> all = {mpcdi_exporter(),      warp_exporter(),
                                            look_exporter(),       opencv_camera_exporter(),
                                            ros_camera_exporter(), kalibr_exporter()};
  return all;
}

Status check_export(const ExportOptions& options) {
  std::string names;
  bool is_any_asked_for = false;
  for (std::size_t i = 0; i < exporters().size(); ++i) {
    const Exporter& exporter = exporters()[i];
    is_any_asked_for |= exporter.is_asked_for(options);
    const char* separator = i == 0 ? "" : i + 1 == exporters().size() ? " or " : ", ";
    names += fmt::format("{}--{} {}", separator, exporter.name, exporter.argument);
  }
  if (!is_any_asked_for) return usage_error("expected {}, found none of them.", names);
  for (const Exporter& exporter : exporters()) {
    LIMN_TRY_STATUS(exporter.check(options));
    if (!exporter.is_asked_for(options) || !exporter.needs_prototype) continue;
    if (options.scene.empty() || options.poses.empty())
      return usage_error("--{}: expected --scene and --poses beside it, found none.", exporter.name);
  }
  return {};
}

bool needs_prototype(const ExportOptions& options) {
  return std::ranges::any_of(exporters(), [&](const Exporter& exporter) {
    return exporter.is_asked_for(options) && exporter.needs_prototype;
  });
}

Result<ExportJob> load_export_job(const ExportOptions& options) {
  ExportJob job;
  LIMN_TRY(job.rig, load_rig(options.rig));
  if (!needs_prototype(options)) return job;
  LIMN_TRY(job.scene, scene::load_usable_scene(options.scene));
  LIMN_TRY(job.posed, scene::load_poses(options.poses, job.scene));
  if (job.rig.projectors.empty())
    return error("{}: expected a rig with projectors, found none.", options.rig.string());
  if (!job.scene.prototype)
    return error("{}: expected a scene with a prototype, found none.", options.scene.string());
  if (!job.posed.world_from_prototype)
    return error("{}: world_from_prototype: expected the pose of the prototype, found none.",
                 options.poses.string());
  if (!options.viewer.empty()) {
    LIMN_TRY(job.viewer, scene::load_viewer(options.viewer));
  } else if (job.scene.viewers.size() == 1) {
    job.viewer = job.scene.viewers[0].fixed;
  }
  const auto needs_viewer = [&](const Exporter& exporter) {
    return exporter.is_asked_for(options) && exporter.needs_viewer(options);
  };
  if (!job.viewer && std::any_of(exporters().begin(), exporters().end(), needs_viewer))
    return usage_error(
        "--viewer: expected a viewer file for --profile 3d and --looks, because the scene has none.");
  for (const Exporter& exporter : exporters())
    if (job.posed.parts.empty() && exporter.is_asked_for(options) && exporter.needs_parts)
      return error("{}: slots: expected the pose of a part for --{}, found none.", options.poses.string(),
                   exporter.name);
  return job;
}

}  // namespace limn::exchange
