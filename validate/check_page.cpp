#include "validate/check_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/file.h"
#include "core/html.h"

namespace limn::validate {
namespace {

constexpr int k_shown_width = 640;

constexpr const char* k_check_style = R"(
table { width: 100%; } td.bad { font-weight: 600; } a { color: inherit; }
.images { display: grid; grid-template-columns: repeat(3, 1fr); gap: .8rem; }
figcaption { font-size: .9rem; }
)";

struct Row {
  const CheckResult* result;
  const CheckReading* reading;
};

std::vector<Row> worst_first(std::span<const CheckResult> results) {
  std::vector<Row> rows;
  for (const CheckResult& result : results)
    for (const CheckReading& reading : result.readings) rows.push_back({&result, &reading});
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
    return a.reading->limit_share() > b.reading->limit_share();
  });
  return rows;
}

std::string limit_text(const CheckLimit& limit) {
  return (limit.measure.least ? "at least " : "at most ") + readable_value(limit.measure, limit.value);
}

HtmlCell check_link(const std::string& name) {
  return {fmt::format("<a href=\"#{0}\">{0}</a>", escaped(name)), ""};
}

std::string table_html(std::span<const CheckResult> results) {
  const HtmlRow headings = {text_cell("check"), text_cell("measured"), text_cell("value", "number"),
                            text_cell("limit", "number"), text_cell("verdict")};
  std::vector<HtmlRow> rows;
  for (const CheckResult& result : results) {
    if (result.problem.empty()) continue;
    rows.push_back({check_link(result.name), {escaped(result.problem), "", 3}, text_cell("FAILED", "bad")});
  }
  for (const Row& row : worst_first(results)) {
    const CheckReading& reading = *row.reading;
    const std::string verdict = reading.good() ? "good" : "bad";
    rows.push_back({check_link(row.result->name), text_cell(reading.limit.measure.what),
                    text_cell(readable_value(reading.limit.measure, reading.value), "number " + verdict),
                    text_cell(limit_text(reading.limit), "number"),
                    text_cell(reading.good() ? "passed" : "MISSED", verdict)});
  }
  return html_table(headings, rows);
}

std::string images_html(const CheckResult& result) {
  std::string html;
  for (const CheckImage& image : result.images) {
    html += fmt::format("<h3>{}</h3>\n<div class=\"images\">\n", escaped(image.title));
    const std::pair<const char*, const cv::Mat*> three[] = {
        {"actual", &image.actual}, {"expected", &image.expected}, {"difference", &image.difference}};
    for (const auto& [what, pixels] : three)
      html += html_figure(html_image(*pixels, k_shown_width, what), "", what);
    html += fmt::format("</div><p class=\"lead\">{}</p>\n", escaped(image.caption));
  }
  return html;
}

}  // namespace

Status write_check_page(std::span<const CheckResult> results,
                        const std::string& renderer,
                        const std::filesystem::path& path) {
  const auto failed = std::count_if(results.begin(), results.end(), [](const auto& r) { return !r.good(); });
  std::string html = fmt::format(
      "<h1>Limn checks: {}</h1>\n<p class=\"lead\">The images of the renderer ({}) are compared with those "
      "of a ray tracer that shares no code with it. The result that is closest to its limit comes "
      "first.</p>\n",
      failed == 0 ? fmt::format("all {} passed", results.size())
                  : fmt::format("{} of {} failed", failed, results.size()),
      escaped(renderer));
  html += table_html(results);
  for (const CheckResult& result : results) {
    html += fmt::format("<h2 id=\"{0}\">{0}</h2>\n<p class=\"lead\">{1} ({2:.1f} s)</p>\n",
                        escaped(result.name), escaped(result.about), result.seconds);
    html += images_html(result);
  }
  return write_file(path, html_page("Limn checks", HtmlColours::of_system, k_check_style, html));
}

std::string check_table(std::span<const CheckResult> results) {
  std::size_t name_width = 0, measure_width = 0;
  for (const CheckResult& result : results) {
    name_width = std::max(name_width, result.name.size());
    for (const CheckReading& reading : result.readings)
      measure_width = std::max(measure_width, reading.limit.measure.name.size());
  }
  std::string text;
  for (const CheckResult& result : results) {
    if (!result.problem.empty())
      text += fmt::format("{:<{}}  FAILED: {}\n", result.name, name_width, result.problem);
    for (const CheckReading& reading : result.readings)
      text += fmt::format("{:<{}}  {:<{}}  {:>12}  {:>20}  {}\n", result.name, name_width,
                          reading.limit.measure.name, measure_width,
                          readable_value(reading.limit.measure, reading.value), limit_text(reading.limit),
                          reading.good() ? "passed" : "MISSED");
  }
  return text;
}

std::string readable_value(const CheckMeasure& measure, double value) {
  if (measure.least) return fmt::format("{:.4g}", value);
  if (measure.unit.empty()) return fmt::format("{:.3g} %", 100 * value);
  return fmt::format("{:.3g}{}{}", value, measure.unit.starts_with('/') ? "" : " ", measure.unit);
}

}  // namespace limn::validate
