#include <algorithm>

#include "calib/report.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

std::string escaped(const std::string& text) {
  std::string out;
  for (char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

// A colour for each pose, around the wheel.
std::string colour_of(int pose, size_t poses) {
  return fmt::format("hsl({:.0f} 70% 62%)", 360.0 * pose / static_cast<double>(std::max<size_t>(poses, 1)));
}

struct Arrow {
  Vector2d px, residual;
  int pose = 0;
  bool outlier = false;
};

constexpr double k_magnified = 100;  // residual arrows over true size

// The imager's picture with every observation and its residual, magnified.
std::string field_svg(const CapturedDevice& device, const std::vector<Arrow>& arrows, size_t poses) {
  const double unit = device.width / 1000.0;
  std::string svg = fmt::format("<svg viewBox='-0.5 -0.5 {} {}' role='img'>", device.width, device.height);
  svg += fmt::format("<rect x='-0.5' y='-0.5' width='{}' height='{}' fill='#10141a'/>", device.width,
                     device.height);
  for (const Arrow& arrow : arrows) {
    const std::string colour = arrow.outlier ? "#ff4d4d" : colour_of(arrow.pose, poses);
    Vector2d shift = k_magnified * arrow.residual;
    const double longest = device.width / 8.0;
    if (!shift.allFinite()) shift.setZero();
    if (shift.norm() > longest) shift *= longest / shift.norm();
    svg += fmt::format("<path d='M{:.1f} {:.1f}l{:.1f} {:.1f}' stroke='{}' stroke-width='{:.2f}'/>",
                       arrow.px.x(), arrow.px.y(), shift.x(), shift.y(), colour, 1.5 * unit);
    svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='{:.2f}' fill='{}'/>", arrow.px.x(), arrow.px.y(),
                       (arrow.outlier ? 4 : 2.4) * unit, colour);
  }
  return svg + "</svg>";
}

std::string figure(const std::string& svg, const std::string& title, const std::string& text) {
  return fmt::format("<figure>{}<figcaption><b>{}</b> {}</figcaption></figure>", svg, escaped(title),
                     escaped(text));
}

std::string camera_figures(const Report& report) {
  const Observations& observations = report.observed.observations;
  std::string html;
  for (size_t i = 0; i < observations.cameras.size(); ++i) {
    std::vector<Arrow> arrows;
    for (size_t k = 0; k < observations.corners.size(); ++k) {
      const CornerSeen& seen = observations.corners[k];
      if (static_cast<size_t>(seen.camera) != i) continue;
      arrows.push_back(
          {seen.px, report.solution.corner_residuals[k], seen.pose, report.solution.corner_outlier[k]});
    }
    const DeviceQuality& quality = report.assessment.devices[i];
    html += figure(
        field_svg(observations.cameras[i], arrows, observations.poses.size()), quality.name,
        fmt::format("board corners, residuals x{:.0f}: {:.3f} px RMS, {} of {} outliers (red), coverage "
                    "{:.0f} %",
                    k_magnified, quality.rms_px, quality.outliers, quality.points, 100 * quality.coverage));
  }
  return html;
}

std::string projector_figures(const Report& report) {
  const Observations& observations = report.observed.observations;
  std::string html;
  for (size_t i = 0; i < observations.projectors.size(); ++i) {
    std::vector<Arrow> fitted, foretold;
    for (size_t k = 0; k < observations.matches.size(); ++k) {
      const Match& match = observations.matches[k];
      if (static_cast<size_t>(match.projector) != i) continue;
      fitted.push_back({match.px_projector, report.solution.match_residuals[k], match.pose,
                        report.solution.match_outlier[k]});
      foretold.push_back({match.px_projector, report.assessment.held_out.residuals[k], match.pose, false});
    }
    const DeviceQuality& quality = report.assessment.devices[observations.cameras.size() + i];
    const size_t poses = observations.poses.size();
    html += figure(
        field_svg(observations.projectors[i], fitted, poses), quality.name,
        fmt::format("matches, residuals x{:.0f}: {:.3f} px RMS, {} of {} outliers (red), coverage {:.0f} %",
                    k_magnified, quality.rms_px, quality.outliers, quality.points, 100 * quality.coverage));
    html += figure(
        field_svg(observations.projectors[i], foretold, poses), quality.name,
        fmt::format("held-out errors x{:.0f}: each pose foretold by a solve that has not seen it; 95 % "
                    "within {:.2f} mm on the board",
                    k_magnified, report.assessment.held_out_error_mm[i]));
  }
  return html;
}

std::string pose_rows(const Report& report) {
  const Observations& observations = report.observed.observations;
  std::string rows;
  for (const HeldOutPose& pose : report.assessment.held_out.poses) {
    const auto found = std::find(observations.poses.begin(), observations.poses.end(), pose.pose);
    rows += fmt::format(
        "<tr><td><i style='background:{}'></i>{}</td><td>{:.3f} px</td><td>{} cells</td></tr>",
        colour_of(static_cast<int>(found - observations.poses.begin()), observations.poses.size()),
        escaped(pose.pose), pose.rms_px, pose.cells);
  }
  return rows;
}

std::string fault_list(const std::vector<Fault>& faults) {
  if (faults.empty()) return "<p>No faults found.</p>";
  std::string html = "<ul>";
  for (const Fault& fault : faults)
    html += fmt::format("<li><b>{}</b>: {}. <em>{}.</em></li>", escaped(fault.name), escaped(fault.evidence),
                        escaped(fault.advice));
  return html + "</ul>";
}

constexpr auto k_style =
    R"(body{background:#0b0e12;color:#dfe5ec;font:15px/1.5 system-ui,sans-serif;margin:0 auto;
max-width:1280px;padding:28px}h1{font-weight:600;margin:0}h1 span{border-radius:6px;padding:2px 12px;color:#0b0e12}
.good{background:#63d68b}.usable{background:#f0c659}.reject{background:#ff6b6b}
.grid{display:grid;grid-template-columns:repeat(auto-fill,minmax(380px,1fr));gap:18px;margin:22px 0}
figure{margin:0;background:#151a21;border-radius:8px;overflow:hidden}figure svg{display:block;width:100%}
figcaption{padding:8px 12px;color:#aab4c0}figcaption b{color:#dfe5ec}td{padding:3px 18px 3px 0}
td i{display:inline-block;width:12px;height:12px;border-radius:3px;margin-right:8px}h2{font-size:17px;margin:24px 0 6px}
)";

}  // namespace

std::string report_html(const Report& report) {
  const Assessment& a = report.assessment;
  const std::string verdict = to_text(a.verdict);
  std::string html =
      "<!doctype html><html lang='en'><meta charset='utf-8'><title>Limn: calibration</title><style>";
  html += k_style;
  html += fmt::format("</style><h1>Calibration <span class='{}'>{}</span></h1>", verdict, verdict);
  html += fmt::format(
      "<p>Held-out {:.3f} px RMS, worst pose {:.3f} px; 95 % of light within {:.2f} mm; {:.0f} % of "
      "lit pixels decoded, {} outliers removed.</p>",
      a.held_out.rms_px, a.held_out.worst_px,
      *std::max_element(a.predicted_error_mm.begin(), a.predicted_error_mm.end()), 100 * a.decoded_share,
      a.decode_outliers);
  html += "<div class='grid'>" + camera_figures(report) + projector_figures(report) + "</div>";
  html += "<h2>Held-out poses</h2><table>" + pose_rows(report) + "</table>";
  html += "<h2>Faults</h2>" + fault_list(a.faults);
  return html + "</html>\n";
}

}  // namespace limn::calib
