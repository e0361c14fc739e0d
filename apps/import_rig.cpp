#include "apps/import_rig.h"

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "core/rig.h"
#include "exchange/rig_files.h"
#include "wizard/measure/pixel_size.h"

namespace limn::apps {
namespace {

Result<std::optional<std::array<int, 2>>> size_given(const std::string& text, const std::string& option) {
  if (text.empty()) return std::optional<std::array<int, 2>>();
  LIMN_TRY(const wizard::PixelSize size, wizard::parse_pixel_size(text, option));
  return std::optional(std::array<int, 2>{size.width, size.height});
}

// Distance in mm between the centres of two devices.
double distance_mm(const Imager& a, const Imager& b) {
  return 1000 *
         (a.imager_from_world.inverse().translation - b.imager_from_world.inverse().translation).norm();
}

nlohmann::ordered_json entry_of(const Imager& device, const Imager& first) {
  return {{"name", device.name},
          {"size", {device.width, device.height}},
          {"lens", device.lens.model.name()},
          {"focal_px", {device.lens.fx(), device.lens.fy()}},
          {"distance_mm", distance_mm(device, first)}};
}

nlohmann::ordered_json entries_of(const std::vector<Imager>& devices, const Imager& first) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Imager& device : devices) list.push_back(entry_of(device, first));
  return list;
}

void print_device(const Imager& device, const Imager& first) {
  const std::string distance =
      &device == &first ? std::string()
                        : fmt::format(", {:.1f} mm from {}", distance_mm(device, first), first.name);
  print_out("{}: {}x{}, focal length {:.1f} px{}\n", device.name, device.width, device.height,
            device.lens.fx(), distance);
}

}  // namespace

Status run_import_rig(const ImportRigOptions& options) {
  exchange::RigFileOptions known;
  known.units = options.units;
  LIMN_TRY(known.camera_size, size_given(options.camera_size, "--camera-size"));
  LIMN_TRY(known.projector_size, size_given(options.projector_size, "--projector"));
  LIMN_TRY(const exchange::RigFile file, exchange::read_rig_files(options.files, known));
  const Rig& rig = file.rig;
  LIMN_TRY_STATUS(save_rig(rig, options.out));
  for (const std::string& remark : file.remarks) log_warning("import: {}", remark);
  const Imager& first = rig.cameras.empty() ? rig.projectors.at(0) : rig.cameras[0];
  if (options.json) {
    const nlohmann::ordered_json report = {{"schema", "limn.import_rig/1"},
                                           {"program", file.program},
                                           {"distances_from", first.name},
                                           {"remarks", file.remarks},
                                           {"cameras", entries_of(rig.cameras, first)},
                                           {"projectors", entries_of(rig.projectors, first)}};
    print_out("{}\n", json_text(report, 2));
    return {};
  }
  print_out("{}, {} camera{}, {} projector{}\n", file.program, rig.cameras.size(),
            rig.cameras.size() == 1 ? "" : "s", rig.projectors.size(), rig.projectors.size() == 1 ? "" : "s");
  for (const auto* devices : {&rig.cameras, &rig.projectors})
    for (const Imager& device : *devices) print_device(device, first);
  return {};
}

}  // namespace limn::apps
