#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/report/deviation_report.h"
#include "calib/report/deviation_views.h"
#include "calib/surface/deviation_scale.h"
#include "core/html.h"
#include "core/svg.h"

namespace limn::calib {
namespace {

constexpr int k_view_width = 1800, k_view_height = 1200, k_shown_width = 1200;

std::string hex(const std::array<std::uint8_t, 3>& rgb) {
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

std::string swatch(const std::string& style, const std::string& text) {
  return fmt::format("<span class='swatch'><i style='{}'></i>{}</span>\n", style, escaped(text));
}

std::string legend(double tolerance_m) {
  std::string html = "<p class='legend'>\n";
  for (int band = -k_deviation_bands; band <= k_deviation_bands; ++band)
    html += swatch("background:" + hex(band_colour_rgb(band)), band_text(band, tolerance_m));
  html += swatch("background:repeating-linear-gradient(135deg,#222 0 3px,#9ab 3px 8px)", "uncertain");
  html += swatch("background:" + hex(k_not_measured_rgb), "not measured");
  return html +
         "</p>\n<p class='soft'>Positive: the prototype is proud of the CAD; negative: it is shy.</p>\n";
}

// How much area has which deviation.
std::string histogram(const Deviation& deviation) {
  constexpr int k_bins = 60;
  constexpr double k_width = 900, k_height = 220, k_foot = 30;
  const double end = 6 * deviation.tolerance_m, bin = 2 * end / k_bins;
  std::vector<double> areas(k_bins, 0);
  for (std::size_t i = 0; i < deviation.states.size(); ++i) {
    if (deviation.states[i] != DeviationState::measured) continue;
    const int at = static_cast<int>(std::floor((static_cast<double>(deviation.distances_m[i]) + end) / bin));
    areas[static_cast<std::size_t>(std::clamp(at, 0, k_bins - 1))] +=
        static_cast<double>(deviation.cad.areas_m2[i]);
  }
  const double most = std::max(1e-12, *std::max_element(areas.begin(), areas.end()));
  Svg svg({0, 0}, {k_width, k_height + k_foot}, "class='bars' font-size='13'");
  for (int k = 0; k < k_bins; ++k) {
    const double middle = (k + 0.5) * bin - end, area = areas[static_cast<std::size_t>(k)];
    // The square root shows the few places that differ beside the many that do not.
    const double height = area > 0 ? std::max(1.5, std::sqrt(area / most) * k_height) : 0;
    svg.rect({k * k_width / k_bins, k_height - height}, {k_width / k_bins - 1, height},
             fmt::format("fill='{}'", hex(band_colour_rgb(deviation_band(middle, deviation.tolerance_m)))),
             fmt::format("{:+.2f} mm: {:.1f} cm2", 1e3 * middle, 1e4 * area));
  }
  svg.line({0, k_height}, {k_width, k_height}, "stroke='#5d6670'");
  for (int k = -6; k <= 6; k += 2)
    svg.text({(k + 6) * k_width / 12, k_height + 20}, fmt::format("{:+g}", 1e3 * k * deviation.tolerance_m),
             fmt::format("fill='#5d6670' text-anchor='{}'", k == -6  ? "start"
                                                            : k == 6 ? "end"
                                                                     : "middle"));
  return svg.element() +
         "<p class='soft'>Deviation in mm, by area of the certain surface (heights are square roots; what "
         "lies "
         "beyond is in the outermost bars).</p>\n";
}

std::string extremes_table(const DeviationReport& report) {
  std::vector<HtmlRow> rows;
  for (std::size_t k = 0; k < report.extremes.size(); ++k) {
    const DeviationExtreme& e = report.extremes[k];
    const auto cell = [](const std::string& text) { return text_cell(text, "number"); };
    rows.push_back({cell(fmt::format("{}", k + 1)), cell(fmt::format("{:+.2f}", 1e3 * e.distance_m)),
                    cell(fmt::format("{:.2f}", 1e3 * e.stddev_m)),
                    cell(fmt::format("{:.0f}", 1e6 * e.area_m2)),
                    cell(fmt::format("{:.1f}, {:.1f}, {:.1f}", 1e3 * e.p_prototype.x(),
                                     1e3 * e.p_prototype.y(), 1e3 * e.p_prototype.z()))});
  }
  const HtmlRow head = {text_cell("no."), text_cell("deviation, mm"), text_cell("standard deviation, mm"),
                        text_cell("area beyond the tolerance, mm2"), text_cell("CAD x, y, z, mm")};
  return rows.empty() ? "" : "<div class='wide'>" + html_table(head, rows) + "</div>\n";
}

std::string pair_table(const std::vector<std::pair<std::string, std::string>>& pairs) {
  std::vector<HtmlRow> rows;
  for (const auto& [name, value] : pairs) rows.push_back({text_cell(name), text_cell(value)});
  return "<div class='wide'>" + html_table({}, rows) + "</div>\n";
}

std::string alignment_table(const DeviationReport& report) {
  const Registration& r = report.registration;
  const auto stddev = [&](int from) {
    return std::sqrt(std::max(
        {r.covariance(from, from), r.covariance(from + 1, from + 1), r.covariance(from + 2, from + 2)}));
  };
  std::string free = "none";
  for (const std::string& direction : r.free_directions)
    free = (free == "none" ? "" : free + "; ") + direction;
  std::vector<std::pair<std::string, std::string>> rows = {{"start", report.start}};
  if (report.start != "given") {
    rows.emplace_back("fit", fmt::format("{} points, {:.3f} mm RMS", r.used, 1e3 * r.rms_m));
    rows.emplace_back("region", report.fit_box ? "a box of the CAD (local best fit)" : "the whole scan");
  }
  rows.emplace_back("standard deviation",
                    fmt::format("{:.3f} mm, {:.4f} degrees", 1e3 * stddev(3), 180 / M_PI * stddev(0)));
  rows.emplace_back("directions that the shape does not determine", free);
  return pair_table(rows);
}

std::string areas_table(const DeviationReport& report) {
  std::vector<std::pair<std::string, std::string>> rows;
  constexpr std::array k_names = {"measured", "uncertain",
                                  "not measured: the scan's surface is beyond the reach",
                                  "not measured: the scan has no surface there"};
  for (std::size_t k = 0; k < k_names.size(); ++k)
    rows.emplace_back(k_names[k], fmt::format("{:.1f} cm2", 1e4 * report.summary.areas_m2[k]));
  const Deviation& d = report.deviation;
  rows.emplace_back("points of the CAD",
                    fmt::format("{}, every {:.2f} mm", d.states.size(), 1e3 * d.cad.spacing_m));
  rows.emplace_back("standard deviation of a point (median)",
                    fmt::format("{:.3f} mm; the scan's own times {:.2f}",
                                1e3 * report.summary.median_stddev_m, d.noise_factor));
  rows.emplace_back(
      "RMS; 95 % of the points are below",
      fmt::format("{:.3f} mm; {:.3f} mm", 1e3 * report.summary.rms_m, 1e3 * report.summary.p95_m));
  return pair_table(rows);
}

std::string views_html(const DeviationReport& report) {
  std::string html = "<div class='views'>\n";
  for (const DeviationView& view :
       deviation_views(report.deviation, report.extremes, k_view_width, k_view_height))
    html += html_figure(html_image(view.image, k_shown_width, "The CAD in the colours of its deviation"),
                        "From " + view.from, "of the CAD's frame");
  return html + "</div>\n";
}

constexpr auto k_deviation_style = R"(
.soft{color:var(--faint)}.legend{display:flex;flex-wrap:wrap;gap:.3rem 1.2rem;margin:1rem 0 .2rem}
.swatch{white-space:nowrap}.swatch i{display:inline-block;width:1.5em;height:1em;border-radius:3px;margin-right:.4em;
vertical-align:-.1em}.views{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,560px),1fr));gap:1.2rem}
.views img{background:none;border:1px solid var(--line)}.bars{max-width:900px;width:100%}.wide{overflow-x:auto}
.notes li{max-width:60rem;margin:.4rem 0}
)";

}  // namespace

std::string deviation_html(const DeviationReport& report) {
  std::string html = fmt::format("<h1>Deviation from the CAD</h1>\n<p class='lead'>{}</p>\n",
                                 escaped(deviation_text(report.summary, report.deviation.tolerance_m)));
  html += fmt::format("<p class='soft'>{} against {}; {}</p>\n", escaped(report.scan), escaped(report.cad),
                      escaped(report.made_at));
  if (!report.warnings.empty()) {
    html += "<ul class='notes'>\n";
    for (const std::string& warning : report.warnings)
      html += "<li class='doubt'>" + escaped(warning) + "</li>\n";
    html += "</ul>\n";
  }
  html += legend(report.deviation.tolerance_m);
  html += views_html(report);
  html += "<h2>Largest deviations</h2>\n" + extremes_table(report);
  html += "<h2>Distribution</h2>\n" + histogram(report.deviation);
  html += "<h2>Alignment</h2>\n" + alignment_table(report);
  html += "<h2>What was measured</h2>\n" + areas_table(report);
  return html_page("Limn: deviation", HtmlColours::light, k_deviation_style, html);
}

}  // namespace limn::calib
