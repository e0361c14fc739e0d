#include "apps/export.h"

#include <fmt/format.h>

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "device/gl_context.h"
#include "exchange/projector_maps.h"
#include "projector/renderer.h"

namespace limn::apps {
namespace {

using nlohmann::ordered_json;

ordered_json report_of(const exchange::ExportJob& job) {
  ordered_json json;
  json["schema"] = "limn.export/1";
  json["projectors"] = ordered_json::array();
  for (std::size_t i = 0; i < job.maps.size(); ++i) {
    const auto pixels = static_cast<double>(job.maps[i].points.total());
    json["projectors"].push_back({{"name", job.rig.projectors[i].name},
                                  {"size", {job.maps[i].points.cols, job.maps[i].points.rows}},
                                  {"lit_share", job.maps[i].lit / pixels},
                                  {"shared_share", job.maps[i].shared / pixels},
                                  {"most_black_lift", job.maps[i].most_lift}});
  }
  return json;
}

void print(const ordered_json& report) {
  for (const auto& projector : report["projectors"]) {
    print_out(
        "{}: {}x{}, {:.1f} % of the pixels reach the prototype, {:.1f} % share it with other projectors{}\n",
        projector["name"].get<std::string>(), projector["size"][0].get<int>(),
        projector["size"][1].get<int>(), 100 * projector["lit_share"].get<double>(),
        100 * projector["shared_share"].get<double>(),
        projector["most_black_lift"] > 0 ? fmt::format(", black is raised by up to {:.4f} of white",
                                                       projector["most_black_lift"].get<double>())
                                         : std::string());
  }
}

// The maps of all projectors, drawn with the current OpenGL context.
Status add_maps(const exchange::ExportOptions& options, exchange::ExportJob* job) {
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(job->scene, job->rig));
  const scene::PosedScene bare{job->posed.world_from_prototype, {}};
  int lit = 0;
  for (std::size_t i = 0; i < job->rig.projectors.size(); ++i) {
    job->maps.push_back(exchange::projector_maps(&renderer, i, bare));
    lit += job->maps.back().lit;
    if (job->maps.back().lit == 0)
      log_warning("export: {} does not reach the prototype; its maps are empty", job->rig.projectors[i].name);
  }
  if (lit == 0) {
    return error("{}: expected a prototype that a projector reaches, found none. Check rig and poses.",
                 options.poses.string());
  }
  return {};
}

}  // namespace

Status run_export(const exchange::ExportOptions& options, bool is_json) {
  LIMN_TRY_STATUS(exchange::check_export(options));
  LIMN_TRY(exchange::ExportJob job, exchange::load_export_job(options));
  std::optional<device::GlContext> context;  // exporters of looks draw, too
  if (exchange::needs_prototype(options)) {
    LIMN_TRY(context, device::GlContext::create());
    log_info("export: {}", context->description());
    LIMN_TRY_STATUS(add_maps(options, &job));
  }
  for (const exchange::Exporter& exporter : exchange::exporters())
    if (exporter.is_asked_for(options)) LIMN_TRY_STATUS(exporter.write(job, options));
  const ordered_json report = report_of(job);
  if (is_json) {
    print_out("{}\n", json_text(report, 2));
  } else {
    print(report);
  }
  return {};
}

}  // namespace limn::apps
