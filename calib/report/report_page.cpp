#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/report/report.h"
#include "calib/report/svg_plots.h"
#include "core/html.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

std::string section(const std::string& title, const std::string& content) {
  if (content.empty()) return "";
  return fmt::format("<section><h2>{}</h2>\n{}</section>\n", escaped(title), content);
}

// A table of texts; empty without rows.
std::string table(const std::vector<std::string>& head, const std::vector<std::vector<std::string>>& rows) {
  if (rows.empty()) return "";
  const auto cells = [](const std::vector<std::string>& texts) {
    HtmlRow row;
    for (const std::string& text : texts) row.push_back(text_cell(text));
    return row;
  };
  std::vector<HtmlRow> html_rows;
  for (const auto& row : rows) html_rows.push_back(cells(row));
  return "<div class='wide'>" + html_table(cells(head), html_rows) + "</div>\n";
}

std::string tile(const std::string& value, const std::string& unit, const std::string& what) {
  return fmt::format("<div class='tile'><b>{}</b> {}<span>{}</span></div>\n", escaped(value), escaped(unit),
                     escaped(what));
}

bool has_projectors(const Report& report) { return !report.observed.observations.projectors.empty(); }

double worst_lens_px(const Assessment& a) {
  return a.lens_stddev_px.empty() ? 0 : *std::max_element(a.lens_stddev_px.begin(), a.lens_stddev_px.end());
}

// The largest residual of all pairs, on the board.
double epipolar_px(const Assessment& a) {
  double worst = 0;
  for (const EpipolarResidual& pair : a.epipolar) worst = std::max(worst, pair.board.rms_px);
  return worst;
}

std::string header(const Report& report) {
  const Assessment& a = report.assessment;
  const std::string verdict = to_text(a.verdict);
  std::string words = report.explanation.verdict;
  if (words.starts_with(verdict + ": ")) words = words.substr(verdict.size() + 2);
  if (!words.empty()) words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
  std::string html =
      fmt::format("<h1>Calibration <span class='{0}'>{0}</span></h1>\n<p class='lead'>{1}</p>\n", verdict,
                  escaped(words));
  html += fmt::format("<p class='soft'>{}</p>\n<div class='tiles'>\n", escaped(report.made_at));
  if (has_projectors(report))
    html +=
        tile(fmt::format("{:.2f}", a.worst_predicted_mm()), "mm", "predicted error (95 %), worst projector");
  else
    html += tile(fmt::format("{:.2f}", worst_lens_px(a)), "px",
                 "uncertainty of the worst camera's lens (standard deviation)");
  html += tile(fmt::format("{:.2f}", a.held_out.rms_px), "px",
               "held-out error: on poses that the solve has not used");
  if (!has_projectors(report)) return html + "</div>\n";
  html += tile(fmt::format("{:.2f}", epipolar_px(a)), "px", "epipolar residual on the board");
  html += tile(fmt::format("{:.0f}", 100 * a.decoded_share), "%", "of illuminated pixels decoded");
  return html + "</div>\n";
}

std::string fault_list(const std::vector<Fault>& faults) {
  if (faults.empty()) return "";
  std::string html = "<ul class='faults'>\n";
  for (const Fault& fault : faults)
    html += fmt::format("<li><b>{}</b>{}{}: {}.<br><em>What to do:</em> {}.</li>\n", to_text(fault.name),
                        fault.poses.empty() ? "" : " in ",
                        escaped(fmt::format("{}", fmt::join(fault.poses, ", "))), escaped(fault.evidence),
                        escaped(fault.advice));
  return html + "</ul>\n";
}

std::string advice_list(const std::vector<std::string>& advice) {
  if (advice.empty()) return "";
  std::string html = "<ul>\n";
  for (const std::string& sentence : advice) html += "<li>" + escaped(sentence) + "</li>\n";
  return html + "</ul>\n";
}

// The predicted error of each projector on planes in front of camera 0.
std::string error_maps_html(const Report& report) {
  const Observations& observations = report.observed.observations;
  const Imager& camera = report.solution.rig.cameras.front();
  double most = 0;
  for (const ErrorMap& map : report.assessment.error_maps) most = std::max(most, map.worst_mm());
  // Outside the volume of the boards the error may grow without limit; the colours cover the rest.
  constexpr double k_brightest = 4;  // times the predicted error
  if (const double predicted = report.assessment.worst_predicted_mm(); std::isfinite(predicted))
    most = std::min(most, k_brightest * predicted);
  std::string html;
  bool is_wide = false;
  for (const ErrorMap& map : report.assessment.error_maps) {
    is_wide = is_wide || map.is_wider_than_image();
    const std::string& name = observations.projectors[static_cast<size_t>(map.projector)].name;
    const Vector2d extent = map.high - map.low;
    html += map.is_wider_than_image() ? "<div class='grid'>\n" : "<div class='small'>\n";
    for (const ErrorMap::Plane& plane : map.planes) {
      double worst = 0;
      for (const double mm : plane.p95_mm) worst = std::isfinite(mm) ? std::max(worst, mm) : worst;
      const Vector2d size_m = map.size_m(camera, plane);
      html += html_figure(
          heat_map(static_cast<int>(std::lround(extent.x() * camera.width)),
                   static_cast<int>(std::lround(extent.y() * camera.height)), map.columns, plane.p95_mm,
                   most),
          fmt::format("{}, {:.2f} m", name, plane.depth_m),
          worst > 0 ? fmt::format("{:.1f} x {:.1f} m, at most {:.2f} mm", size_m.x(), size_m.y(), worst)
                    : "out of reach");
    }
    html += "</div>\n";
  }
  if (html.empty() || !(most > 0)) return "";
  return fmt::format(
      "<p>95 % error of light on a target whose pose {} measures, on planes across {}. Red: this value "
      "or more. Grey: {}.</p>{}\n{}",
      escaped(is_wide ? "the camera that sees most of it" : camera.name),
      escaped(is_wide ? camera.name + "'s view and beyond it, as far as boards stood" : "its view"),
      is_wide ? "no camera sees it, or the projector does not reach it" : "the projector does not reach",
      colour_key(most, "mm"), html);
}

// A camera's matches of a projector, with their held-out errors.
std::vector<Dot> board_errors(const Report& report, size_t projector, size_t camera) {
  const Observations& observations = report.observed.observations;
  std::vector<Dot> dots;
  for (size_t k = 0; k < observations.matches.size(); ++k) {
    const Match& match = observations.matches[k];
    const double error = report.assessment.held_out.errors_m[k] * 1e3;
    if (static_cast<size_t>(match.projector) == projector && static_cast<size_t>(match.camera) == camera &&
        std::isfinite(error))
      dots.push_back({match.px_camera, error});
  }
  return dots;
}

// Held-out errors on the boards in the cameras' images.
std::string board_errors_html(const Report& report) {
  const Observations& observations = report.observed.observations;
  const auto& errors = report.assessment.held_out_error_mm;
  double most = 0;
  for (const double mm : errors) most = std::isfinite(mm) ? std::max(most, mm) : most;
  if (!(most > 0)) return "";
  std::string html = "<div class='grid'>\n";
  for (size_t i = 0; i < observations.projectors.size(); ++i) {
    for (size_t c = 0; c < observations.cameras.size(); ++c) {
      const CapturedDevice& camera = observations.cameras[c];
      const std::vector<Dot> dots = board_errors(report, i, c);
      if (c > 0 && dots.empty()) continue;
      html += html_figure(
          dot_map(camera.width, camera.height, dots, most), observations.projectors[i].name,
          fmt::format("on all boards, in {}'s image: 95 % within {:.2f} mm", camera.name, errors[i]));
    }
  }
  return "<p>Each board pose is predicted by a solve that has not used it. The colour shows how far "
         "the light would land from its target on the board.</p>" +
         colour_key(most, "mm") + html + "</div>\n";
}

std::string poses_html(const Report& report) {
  std::vector<Bar> bars;
  for (const HeldOutPose& pose : report.assessment.held_out.poses)
    bars.push_back({pose.pose, pose.rms_px, fmt::format("{:.3f} px, {} cells", pose.rms_px, pose.cells)});
  return "<div class='wide'>" + bar_chart(bars, k_good_px, fmt::format("good: {} px", k_good_px)) +
         "</div>\n";
}

struct Fields {
  std::vector<FieldPoint> fitted, predicted;
};

std::string imager_figure(const CapturedDevice& device,
                          const std::vector<FieldPoint>& points,
                          const DeviceQuality& quality,
                          const std::string& what) {
  const SvgPlot plot = residual_field(device.width, device.height, points);
  return html_figure(
      plot.svg, device.name,
      fmt::format("{}: {:.3f} px RMS, {} of {} outliers, {:.0f} % covered. {}.", what, quality.rms_px,
                  quality.outliers, quality.points, 100 * quality.coverage, plot.key));
}

std::string imagers_html(const Report& report) {
  const Observations& observations = report.observed.observations;
  const Solution& solution = report.solution;
  std::string html = "<div class='grid'>\n";
  for (size_t i = 0; i < observations.cameras.size(); ++i) {
    std::vector<FieldPoint> points;
    for (size_t k = 0; k < observations.corners.size(); ++k) {
      const CornerObservation& seen = observations.corners[k];
      if (static_cast<size_t>(seen.camera) == i)
        points.push_back({seen.px, solution.corner_residuals[k], solution.corner_outlier[k]});
    }
    html += imager_figure(observations.cameras[i], points, report.assessment.devices[i], "board corners");
  }
  for (size_t i = 0; i < observations.projectors.size(); ++i) {
    std::vector<FieldPoint> fitted, predicted;
    for (size_t k = 0; k < observations.matches.size(); ++k) {
      const Match& match = observations.matches[k];
      if (static_cast<size_t>(match.projector) != i) continue;
      fitted.push_back({match.px_projector, solution.match_residuals[k], solution.match_outlier[k]});
      const Vector2d& error = report.assessment.held_out.residuals[k];
      if (error.allFinite()) predicted.push_back({match.px_projector, error, false});
    }
    const CapturedDevice& device = observations.projectors[i];
    html +=
        imager_figure(device, fitted, report.assessment.devices[observations.cameras.size() + i], "matches");
    const SvgPlot plot = residual_field(device.width, device.height, predicted);
    html += html_figure(
        plot.svg, device.name + ", held-out poses",
        fmt::format("prediction by a solve without the pose: 95 % within {:.2f} mm on the board. {}.",
                    report.assessment.held_out_error_mm[i], plot.key));
  }
  return html + "</div>\n";
}

std::string devices_table(const Report& report) {
  std::vector<std::vector<std::string>> rows;
  const size_t cameras = report.observed.observations.cameras.size();
  for (size_t i = 0; i < report.assessment.devices.size(); ++i) {
    const DeviceQuality& d = report.assessment.devices[i];
    const Imager& imager =
        i < cameras ? report.solution.rig.cameras[i] : report.solution.rig.projectors[i - cameras];
    const bool is_camera = i < cameras;
    rows.push_back(
        {d.name, imager.lens.model.name(), fmt::format("{:.3f}", d.rms_px),
         fmt::format("{} / {}", d.outliers, d.points), fmt::format("{:.0f} %", 100 * d.coverage),
         is_camera ? "" : fmt::format("{:.2f}", report.assessment.held_out_error_mm[i - cameras]),
         is_camera ? "" : fmt::format("{:.2f}", report.assessment.propagated_error_mm[i - cameras])});
  }
  return table({"device", "lens", "residual px", "outliers", "coverage", "held-out mm", "noise mm"}, rows);
}

std::string lenses_table(const Report& report) {
  std::vector<std::vector<std::string>> rows;
  for (const ModelTrial& trial : report.lens_trials)
    rows.push_back(
        {trial.device, trial.model,
         std::isfinite(trial.held_out_px) ? fmt::format("{:.3f}", trial.held_out_px) : "no solution",
         trial.gain == 0 && trial.uncertainty == 0
             ? ""
             : fmt::format("{:+.0f} % (chance: {:.0f} %)", 100 * trial.gain, 100 * trial.uncertainty),
         trial.chosen ? "chosen" : ""});
  return table({"device", "lens model", "held-out px", "gain of the richer model", ""}, rows);
}

std::string trust_tables(const Report& report) {
  const Observations& observations = report.observed.observations;
  const auto score = [](const EpipolarScore& s) {
    return s.pixels == 0 ? std::string("none")
                         : fmt::format("{:.3f} px ({} of {} beyond {} px)", s.rms_px, s.outliers, s.pixels,
                                       k_epipolar_outlier_px);
  };
  std::vector<std::vector<std::string>> rows;
  for (const EpipolarResidual& pair : report.assessment.epipolar)
    rows.push_back({observations.cameras[static_cast<size_t>(pair.camera)].name + " to " +
                        observations.projectors[static_cast<size_t>(pair.projector)].name,
                    score(pair.board), score(pair.room)});
  std::string html = table({"epipolar residual", "on the board", "in the room"}, rows);
  rows.clear();
  const NormalisedResiduals& normalised_residuals = report.assessment.normalised_residuals;
  for (const auto& [name, s] : {std::pair{"corners", normalised_residuals.corners},
                                {"matches", normalised_residuals.matches},
                                {"held-out poses", normalised_residuals.held_out}})
    rows.push_back({name, fmt::format("{:.2f}", s.mean), fmt::format("{:.2f}", s.stddev),
                    fmt::format("{:.1f} %", 100 * s.beyond_3), fmt::format("{}", s.count)});
  return html + table({"residual / stated deviation", "mean (0)", "deviation (1)", "beyond 3 (0.3 %)",
                       "coordinates"},
                      rows);
}

std::string lengths_table(const Report& report) {
  std::vector<std::vector<std::string>> rows;
  for (const ScaleBarCheck& check : report.scale_bar_lengths) {
    const double expected = 1e3 * check.known.length_m, measured = 1e3 * check.measured_m;
    const std::string name = check.known.text();
    if (check.views.empty()) {
      rows.push_back({name, fmt::format("{:.2f}", expected), "not seen", "", "0"});
      continue;
    }
    rows.push_back({name, fmt::format("{:.2f}", expected),
                    fmt::format("{:.2f} (deviation {:.2f})", measured, 1e3 * check.stddev_m),
                    fmt::format("{:+.2f} ({:+.2f} %)", measured - expected, 100 * (measured / expected - 1)),
                    fmt::format("{}", check.views.size())});
  }
  return table({"length", "expected mm", "measured mm", "difference mm", "views"}, rows);
}

std::string decode_table(const Report& report) {
  const Observations& observations = report.observed.observations;
  std::vector<std::vector<std::string>> rows;
  for (const DecodeShare& share : report.observed.decoded) {
    const double lit = std::max(share.lit, 1);
    rows.push_back({observations.poses[static_cast<size_t>(share.pose)],
                    observations.cameras[static_cast<size_t>(share.camera)].name,
                    observations.projectors[static_cast<size_t>(share.projector)].name,
                    fmt::format("{}", share.lit), fmt::format("{:.1f} %", 100 * share.decoded / lit),
                    fmt::format("{:.1f} %", 100.0 * share.decoded / std::max(share.contrasted, 1)),
                    fmt::format("{:.2f} %", 100 * share.outliers / lit)});
  }
  return table({"pose", "camera", "projector", "illuminated pixels", "decoded",
                "share of all brightened pixels", "outliers"},
               rows);
}

std::string moved_text(const std::vector<DeviceMove>& devices) {
  std::string text;
  for (const DeviceMove& device : devices)
    text += fmt::format(
        "{}{} {:.2f}°, {:.1f} mm{}", text.empty() ? "" : "; ", device.name, device.degrees, device.mm,
        std::isfinite(device.px) ? fmt::format(" ({:.2f} px on the same points)", device.px) : "");
  return text;
}

std::string history_html(const Report& report) {
  if (report.history.past.empty()) return "";
  const Assessment& a = report.assessment;
  std::vector<std::vector<std::string>> rows;
  std::vector<double> held_out;
  const auto mm = [](double v) { return std::isfinite(v) ? fmt::format("{:.2f}", v) : std::string(); };
  for (const PastCalibration& past : report.history.past) {
    rows.push_back({past.made_at.empty() ? "earlier" : past.made_at, past.verdict,
                    fmt::format("{:.3f}", past.held_out_px), mm(past.predicted_mm), moved_text(past.moved)});
    held_out.push_back(past.held_out_px);
  }
  const auto now = report.history.rig
                       ? device_moves(*report.history.rig, report.observed.observations, report.solution)
                       : std::vector<DeviceMove>();
  rows.push_back({report.made_at + " (this one)", to_text(a.verdict),
                  fmt::format("{:.3f}", a.held_out.rms_px), mm(a.worst_predicted_mm()), moved_text(now)});
  held_out.push_back(a.held_out.rms_px);
  std::reverse(rows.begin(), rows.end());
  return html_figure(sparkline(held_out), "Held-out error, px RMS,", "oldest to newest") +
         table({"made", "verdict", "held-out px", "predicted mm",
                "moved since the one before, relative to camera0"},
               rows);
}

constexpr auto k_style = R"(
*{box-sizing:border-box}
body{background:#fff;color:#1d2329;max-width:1180px;padding:28px 20px 60px}
h1{font-size:28px;margin:0 0 8px}h1 span.good,h1 span.usable,h1 span.reject{border-radius:6px;padding:1px 12px;color:#fff}
h1 .good{background:#2c8a4b}h1 .usable{background:#b97a06}h1 .reject{background:#c43139}
h2{font-size:19px;margin:40px 0 10px}.lead{color:inherit;font-size:18px;margin:0 0 6px;max-width:52em}
.soft,figcaption,th{color:#5d6670}.soft{margin:0;font-size:14px}p{max-width:60em}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:12px;margin:20px 0 0}
.tile{background:#f5f6f8;border-radius:8px;padding:12px 14px}.tile b{font-size:26px;font-weight:600}
.tile span{display:block;color:#5d6670;font-size:14px;line-height:1.35}
.grid{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,460px),1fr));gap:22px;margin:12px 0}
.small{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(47%,200px),1fr));gap:12px;margin:12px 0}
figure svg{display:block;width:100%;height:auto}figcaption{font-size:14px}
.key{width:320px;max-width:100%;display:block}.bars{width:760px;max-width:none;height:auto}
.spark{max-width:420px}ul{padding-left:20px;max-width:60em}li{margin:6px 0}
.faults{list-style:none;padding:0}.faults li{border-left:4px solid #c43139;background:#fdf3f3;padding:8px 14px;
border-radius:0 6px 6px 0}.faults em{font-style:normal;color:#5d6670}
.wide{overflow-x:auto;margin:10px 0}table{font-size:14px;font-variant-numeric:tabular-nums}
th,td{white-space:nowrap;padding:5px 22px 5px 0}td:nth-child(5){white-space:normal;min-width:12em}
)";

}  // namespace

std::string report_html(const Report& report) {
  std::string html = header(report);
  html += section("Faults", fault_list(report.assessment.faults));
  html += section("What would help", advice_list(report.explanation.advice));
  html += section("Error maps of the working volume", error_maps_html(report));
  html += section("Held-out error on the boards", board_errors_html(report));
  html += section("Held-out error of each pose", poses_html(report));
  html += section("Observations and residuals of each device", imagers_html(report));
  html += section("Devices", devices_table(report));
  html += section("Lens models tried", lenses_table(report));
  html += section("Consistency checks", trust_tables(report));
  html += section("Scale bars, measured with structured light", lengths_table(report));
  html += section("Decoding", decode_table(report));
  html += section("Earlier calibrations of this rig", history_html(report));
  return html_page("Limn: calibration", HtmlColours::light, k_style, html);
}

}  // namespace limn::calib
