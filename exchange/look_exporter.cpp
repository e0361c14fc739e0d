#include "exchange/look_exporter.h"

#include <fmt/format.h>

#include <opencv2/core.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "projector/renderer.h"

namespace limn::exchange {
namespace {

// Draws every placed slot's variants, one at a time, as the viewer sees them over black.
Status write_looks(const ExportJob& job, const ExportOptions& options) {
  LIMN_TRY_STATUS(make_folder(options.looks));
  Rig rig;
  rig.cameras = {*job.viewer};
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(job.scene, rig));
  const cv::Mat black = cv::Mat::zeros(job.viewer->height, job.viewer->width, CV_8UC3);
  for (const scene::PosedPart& part : job.posed.parts) {
    const scene::Slot* slot = job.scene.find_slot(part.slot);
    for (const scene::Variant& variant : slot->variants) {
      scene::PosedScene alone{job.posed.world_from_prototype, {part}};
      alone.parts[0].variant = variant.name;
      const auto file = options.looks / fmt::format("look-{}-{}.png", part.slot, variant.name);
      LIMN_TRY_STATUS(write_png(file, renderer.composite(0, black, alone, projector::Composite::full)));
    }
  }
  return {};
}

}  // namespace

Exporter look_exporter() {
  return {.name = "looks",
          .argument = "DIR",
          .path = &ExportOptions::looks,
          .check = [](const ExportOptions&) { return Status(); },
          .needs_viewer = [](const ExportOptions&) { return true; },
          .needs_parts = true,
          .write = write_looks};
}

}  // namespace limn::exchange
