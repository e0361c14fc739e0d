#include "exchange/cad_import.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "core/log.h"
#include "core/print.h"
#include "scene/files/source_file.h"
#include "scene/meshes/mesh_content.h"

namespace limn::exchange {
namespace {

using nlohmann::ordered_json;

// A step that shows no progress may take this share of the time.
constexpr double k_silent_share = 0.2;

std::string sentence_of(const ordered_json& solid) {
  double size_mm[3];
  for (std::size_t i = 0; i < 3; ++i)
    size_mm[i] = 1e3 * (solid["box_m"][1][i].get<double>() - solid["box_m"][0][i].get<double>());
  return fmt::format("{}: {:.1f} x {:.1f} x {:.1f} mm, {} triangles, chord error {:.3f} mm{}",
                     solid["name"].get<std::string>(), size_mm[0], size_mm[1], size_mm[2],
                     solid["triangles"].get<std::size_t>(), solid["chord_error_mm"].get<double>(),
                     solid["closed"].get<bool>() ? "" : ", not closed");
}

void print_report(const ordered_json& report) {
  print_out("{}{}{}, unit {}: {} solids of {} shapes, {} triangles, chord error {:.3f} mm\n",
            report["format"].get<std::string>(), report["application_protocol"] == "" ? "" : " ",
            report["application_protocol"].get<std::string>(),
            report["unit"].get<std::string>().empty() ? "not stated" : report["unit"].get<std::string>(),
            report["solids"].size(), report["meshes"].get<std::size_t>(),
            report["triangles"].get<std::size_t>(), report["chord_error_mm"].get<double>());
  for (const auto& solid : report["solids"]) print_out("{}\n", sentence_of(solid));
  for (const auto& file : report["files"]) print_out("wrote {}\n", file["file"].get<std::string>());
}

}  // namespace

Status import_cad(const CadImportOptions& options) {
  const bool is_glb = scene::lower_extension(options.out) == ".glb";
  if (is_glb != (options.as == CadTakenAs::part))
    return usage_error("--out: expected {} with --as {}, found '{}'.",
                       is_glb ? "a folder" : "a file NAME.glb", k_cad_taken_as.text(options.as),
                       options.out.string());
  LIMN_TRY_STATUS(scene::check_regular_file(options.file));
  const double seconds = 60 * options.minutes;
  const scene::CadLimits limits{
      .seconds = seconds, .silent_seconds = k_silent_share * seconds, .memory_mb = 1024 * options.memory_gb};
  LIMN_TRY(const std::string text,
           scene::run_limn_cad(
               options.file,
               {"--out", options.out.string(), "--as", k_cad_taken_as.text(options.as), "--chord-mm",
                fmt::format("{}", options.chord_mm), "--angle-deg", fmt::format("{}", options.angle_deg)},
               limits));
  const ordered_json report = ordered_json::parse(text, nullptr, false);
  if (report.is_discarded() || report.value("schema", "") != "limn.cad/1")
    return error(
        "{}: expected a report limn.cad/1 of limn-cad, found another text. Install limn and limn-cad in the "
        "same version.",
        options.file.string());
  for (const auto& warning : report["warnings"])
    log_warning("{}: {}.", options.file.string(), warning.get<std::string>());
  if (options.json)
    print_out("{}\n", json_text(report, 2));
  else
    print_report(report);
  return {};
}

}  // namespace limn::exchange
