#include "exchange/warp_exporter.h"

#include <fmt/format.h>

#include <cstddef>
#include <string>

#include "core/file.h"
#include "exchange/pfm.h"
#include "scene/files/exr_image.h"

namespace limn::exchange {
namespace {

Status write_warps(const ExportJob& job, const ExportOptions& options) {
  LIMN_TRY_STATUS(make_folder(options.warp));
  for (std::size_t i = 0; i < job.maps.size(); ++i) {
    const std::string name =
        fmt::format("warp-{}.{}", job.rig.projectors[i].name, k_warp_formats.text(options.format));
    const cv::Mat& points = job.maps[i].points;
    const auto bytes =
        options.format == WarpFormat::pfm
            ? Result<std::string>(pfm_bytes(points))
            : scene::encode_exr(
                  points, "R, G, B: x, y, z (m) of the prototype's point that the pixel lights; NaN: none");
    if (!bytes) return bytes.error();
    LIMN_TRY_STATUS(write_file(options.warp / name, *bytes));
  }
  return {};
}

}  // namespace

Exporter warp_exporter() {
  return {.name = "warp",
          .argument = "DIR",
          .path = &ExportOptions::warp,
          .check = [](const ExportOptions&) { return Status(); },
          .needs_viewer = [](const ExportOptions&) { return false; },
          .write = write_warps};
}

}  // namespace limn::exchange
