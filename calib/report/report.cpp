#include "calib/report/report.h"

#include <nlohmann/json.hpp>

#include "calib/report/rounded.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/rig.h"

namespace limn::calib {
namespace {

using Json = nlohmann::ordered_json;

std::string provenance(const Report& report, const SolveOptions& options) {
  const Observations& observations = report.observed.observations;
  Json json = {{"made_by", "limn solve"},
               {"board", observations.board.text()},
               {"board_bend_mm",
                {rounded(report.solution.bend_m.x() * 1e3), rounded(report.solution.bend_m.y() * 1e3)}},
               {"poses", observations.poses},
               {"corners", observations.corners.size()},
               {"matches", observations.matches.size()},
               {"lens_models", lens_models(observations, options)},
               {"held_out_px", rounded(report.assessment.held_out.rms_px)}};
  if (report.solution.print.size() > 0) {
    json["board_twist_mm"] = rounded(1e3 * report.solution.twist_m);
    json["board_print_mm"] = Json::array();
    for (const double mode : report.solution.print) json["board_print_mm"].push_back(1e3 * mode);
  }
  return json_text(json);
}

}  // namespace

bool note_cad_size(const ScanSize& size, Report* report) {
  const Board& board = report->observed.observations.board;
  const bool shows_size = size.stddev > 0 && size.stddev <= expected_growth(board, {}).stddev;
  if (!shows_size || board.is_exact || report->scale_rests_on != "board") return false;
  const bool is_wrong = contradicts(size);
  if (is_wrong)
    add_faults(
        {{FaultName::wrong_scale,
          fmt::format("the scan is {:.4f} times as large as the CAD (standard deviation {:.4f}). The rig "
                      "keeps the board's size, because the model may have been built in another size",
                      size.ratio, size.stddev),
          "measure a length on the model, and the board (--board-measured)", Severity::doubt}},
        &report->assessment);
  else
    report->scale_rests_on = "cad";
  report->explanation = explain(report->observed, report->solution, report->assessment, !is_wrong);
  return true;
}

Status write_report(const Report& report, const std::filesystem::path& folder) {
  const std::string json = report_json(report), html = report_html(report);
  return write_together(folder, [&](const std::filesystem::path& into) -> Status {
    LIMN_TRY_STATUS(write_file(into / "report.html", html));
    return write_file(into / "report.json", json);
  });
}

Status write_rig_folder(const Report& report,
                        const SolveOptions& options,
                        const std::filesystem::path& folder) {
  const std::string json = report_json(report), html = report_html(report);
  Rig rig = report.solution.rig;
  rig.provenance_json = provenance(report, options);
  return write_together(folder, [&](const std::filesystem::path& into) -> Status {
    LIMN_TRY_STATUS(save_rig(rig, into));
    LIMN_TRY_STATUS(save_observations(report.observed.observations, into / "observations.json"));
    LIMN_TRY_STATUS(write_file(into / "report.html", html));
    return write_file(into / "report.json", json);
  });
}

}  // namespace limn::calib
