#include "validate/hardware_report/page.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/html.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/svg.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* k_style = R"(
table { margin: 0 0 1.6rem; }
td { vertical-align: top; overflow-wrap: anywhere; }
td:first-child { white-space: nowrap; padding-right: 1.5rem; }
.images { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 32rem)); gap: 1.2rem; }
svg { width: 100%; height: auto; }
)";

std::string in_words(const ordered_json& value) {
  return value.is_string()         ? value.get<std::string>()
         : value.is_number_float() ? fmt::format("{:.3f}", value.get<double>())
                                   : json_text(value);
}

// What a step measured, a row for each key; lists and objects get rows of their own.
void add_rows(const std::string& name, const ordered_json& value, std::vector<HtmlRow>* rows) {
  if (!value.is_structured()) return rows->push_back({text_cell(name), text_cell(in_words(value))});
  if (value.contains("area") && value.contains("state")) {
    const std::string state = value.value("state", "");
    const std::string advice = value.value("advice", "");
    return rows->push_back({text_cell(fmt::format("{} {}", value.value("area", ""), value.value("name", ""))),
                            text_cell(value.value("text", "") + (advice.empty() ? "" : ". " + advice),
                                      state == "works"  ? "good"
                                      : state == "note" ? "doubt"
                                                        : "bad")});
  }
  int number = 0;
  for (const auto& [key, part] : value.items()) {
    const std::string own = value.is_array() ? std::to_string(++number) : key;
    add_rows(name.empty() ? own : fmt::format("{} {}", name, own), part, rows);
  }
}

// Bars for the distances of frames, in bins of equal width.
std::string distances_drawing(const ordered_json& distances_ms) {
  constexpr int k_bins = 40;
  constexpr double k_width = 800, k_height = 180, k_base = 150;
  std::vector<double> values;
  for (const ordered_json& value : distances_ms)
    if (value.is_number()) values.push_back(value.get<double>());
  if (values.size() < 2) return "";
  const double top = std::max(1e-3, 1.1 * *std::ranges::max_element(values));
  std::vector<int> counts(k_bins, 0);
  for (const double value : values)
    ++counts[static_cast<std::size_t>(std::clamp(static_cast<int>(k_bins * value / top), 0, k_bins - 1))];
  const double most = *std::ranges::max_element(counts);
  Svg svg({0, 0}, {k_width, k_height});
  for (int i = 0; i < k_bins; ++i) {
    const double height = 140 * counts[static_cast<std::size_t>(i)] / most;
    svg.rect({i * k_width / k_bins, k_base - height}, {k_width / k_bins - 2, height}, "fill='var(--good)'",
             fmt::format("{}", counts[static_cast<std::size_t>(i)]));
  }
  svg.line({0, k_base}, {k_width, k_base}, "stroke='var(--line)'");
  svg.text({0, k_height - 8}, "0 ms", "fill='var(--faint)' font-size='14'");
  svg.text({k_width, k_height - 8}, fmt::format("{:.1f} ms", top),
           "fill='var(--faint)' font-size='14' text-anchor='end'");
  return html_figure(svg.element(), "Distances of frames.", "Each bar counts the distances of two stamps.");
}

std::string images_of(const ordered_json& step, const fs::path& folder) {
  if (!step.contains("images")) return "";
  std::string html;
  for (const ordered_json& file : step["images"]) {
    const auto name = file.get<std::string>();
    const auto image = read_image(folder / name);
    if (image) html += html_figure(html_image(*image, 640, name), name + ".", "");
  }
  return html.empty() ? "" : "<div class=\"images\">\n" + html + "</div>\n";
}

std::string step_html(const std::string& name, const ordered_json& step, const fs::path& folder) {
  const std::string state = step.value("state", "");
  std::string html = fmt::format("<h2>{}</h2>\n<p class=\"{}\">{}</p>\n", escaped(name),
                                 state == "done"     ? "good"
                                 : state == "failed" ? "bad"
                                                     : "doubt",
                                 escaped(state + (step.contains("why") ? ": " + step.value("why", "") : "")));
  std::vector<HtmlRow> rows;
  if (step.contains("measured")) add_rows("", step["measured"], &rows);
  if (!rows.empty()) html += html_table({}, rows);
  if (step.contains("distances_ms")) html += distances_drawing(step["distances_ms"]);
  return html + images_of(step, folder);
}

}  // namespace

Status write_report_page(const ordered_json& report, const fs::path& folder) {
  std::string odd, steps;
  for (const auto& [name, step] : report["steps"].items()) {
    steps += step_html(name, step, folder);
    if (step.contains("odd"))
      for (const ordered_json& sentence : step["odd"])
        odd += fmt::format("<li class=\"doubt\">{}</li>\n", escaped(sentence.get<std::string>()));
    if (step.value("state", "") == "failed")
      odd += fmt::format("<li class=\"bad\">{}: {}</li>\n", escaped(name), escaped(step.value("why", "")));
  }
  std::string html = fmt::format("<h1>Limn hardware report</h1>\n<p class=\"lead\">Limn {}, {}, {}.</p>\n",
                                 escaped(report.value("limn", "")), escaped(report.value("begun", "")),
                                 escaped(report.value("devices", "")));
  html += "<h2>What is odd</h2>\n" +
          (odd.empty() ? "<p class=\"good\">Nothing.</p>\n" : "<ul>\n" + odd + "</ul>\n");
  return write_file(folder / "report.html",
                    html_page("Limn hardware report", HtmlColours::of_system, k_style, html + steps));
}

}  // namespace limn::validate
