#include "exchange/camera_exporter.h"

#include <filesystem>
#include <string>
#include <vector>

#include "core/file.h"
#include "exchange/camera_writer.h"

namespace limn::exchange {
namespace {

// Cameras first, then projectors.
std::vector<Imager> all_imagers(const Rig& rig) {
  std::vector<Imager> imagers = rig.cameras;
  imagers.insert(imagers.end(), rig.projectors.begin(), rig.projectors.end());
  return imagers;
}

Status write_each(const Rig& rig,
                  const std::filesystem::path& folder,
                  const std::string& extension,
                  Result<std::string> (*text_of)(const Imager&)) {
  std::vector<std::pair<std::filesystem::path, std::string>> files;
  for (const Imager& imager : all_imagers(rig)) {
    LIMN_TRY(std::string text, text_of(imager));
    files.emplace_back(folder / (imager.name + extension), std::move(text));
  }
  LIMN_TRY_STATUS(make_folder(folder));
  for (const auto& [path, text] : files) LIMN_TRY_STATUS(write_file(path, text));
  return {};
}

Exporter of_rig(const char* name,
                const char* argument,
                std::filesystem::path ExportOptions::*path,
                Status (*write)(const ExportJob&, const ExportOptions&)) {
  return {.name = name,
          .argument = argument,
          .path = path,
          .check = [](const ExportOptions&) { return Status(); },
          .needs_viewer = [](const ExportOptions&) { return false; },
          .needs_prototype = false,
          .write = write};
}

}  // namespace

Exporter opencv_camera_exporter() {
  return of_rig("opencv", "DIR", &ExportOptions::opencv,
                [](const ExportJob& job, const ExportOptions& options) {
                  return write_each(job.rig, options.opencv, ".yml", opencv_camera_text);
                });
}

Exporter ros_camera_exporter() {
  return of_rig("ros", "DIR", &ExportOptions::ros, [](const ExportJob& job, const ExportOptions& options) {
    return write_each(job.rig, options.ros, ".yaml", ros_camera_text);
  });
}

Exporter kalibr_exporter() {
  return of_rig("kalibr", "FILE", &ExportOptions::kalibr,
                [](const ExportJob& job, const ExportOptions& options) -> Status {
                  LIMN_TRY(const std::string text, kalibr_text(all_imagers(job.rig)));
                  return write_file(options.kalibr, text);
                });
}

}  // namespace limn::exchange
