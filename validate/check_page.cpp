#include "validate/check_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/file.h"
#include "core/html.h"
#include "core/image_io.h"

namespace limn::apps {
namespace {

constexpr int k_shown_width = 640;

constexpr const char* k_check_style = R"(
:root { color-scheme: light dark; --ground: #fbfaf8; --text: #1d1f23; --faint: #6b6862; --line: #dddad3;
        --good: #17683c; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ground: #14161a; --text: #e8e6e1; --faint: #a9a69f;
        --line: #2b2f36; --good: #7fd1a0; --bad: #ff9a7a; } }
body { margin: 0 auto; max-width: 1320px; padding: 2rem 1.5rem 4rem; background: var(--ground);
       color: var(--text); font: 16px/1.5 system-ui, sans-serif; }
h1 { font-weight: 600; margin: 0 0 .3rem; } h2 { font-weight: 600; margin: 2.5rem 0 .2rem; }
h3 { font-weight: 500; font-size: 1rem; margin: 1.4rem 0 .3rem; }
.lead { color: var(--faint); margin: 0 0 1.5rem; max-width: 50rem; }
table { border-collapse: collapse; width: 100%; } th { text-align: left; color: var(--faint); font-weight: 500; }
td, th { padding: .3rem 1rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.number, th.number { font-variant-numeric: tabular-nums; text-align: right; white-space: nowrap; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; }
a { color: inherit; }
.pictures { display: grid; grid-template-columns: repeat(3, 1fr); gap: .8rem; }
figure { margin: 0; } img { width: 100%; display: block; border-radius: 4px; background: #000; }
figcaption { color: var(--faint); font-size: .9rem; }
)";

struct Row {
  const CheckResult* result;
  const CheckReading* reading;
};

std::vector<Row> worst_first(std::span<const CheckResult> results) {
  std::vector<Row> rows;
  for (const CheckResult& result : results)
    for (const CheckReading& reading : result.readings) rows.push_back({&result, &reading});
  std::stable_sort(rows.begin(), rows.end(),
                   [](const Row& a, const Row& b) { return a.reading->strain() > b.reading->strain(); });
  return rows;
}

std::string limit_text(const CheckLimit& limit) {
  return (limit.measure.least ? "at least " : "at most ") + readable_value(limit.measure, limit.value);
}

std::string table_html(std::span<const CheckResult> results) {
  std::string html =
      "<table><tr><th>check</th><th>measured</th><th class=\"number\">value</th><th "
      "class=\"number\">limit</th>"
      "<th>verdict</th></tr>\n";
  for (const CheckResult& result : results) {
    if (result.problem.empty()) continue;
    html += fmt::format(
        "<tr><td><a href=\"#{0}\">{0}</a></td><td colspan=\"3\">{1}</td><td class=\"bad\">FAILED</td></tr>\n",
        escaped(result.name), escaped(result.problem));
  }
  for (const Row& row : worst_first(results)) {
    const CheckReading& reading = *row.reading;
    const char* verdict = reading.good() ? "good" : "bad";
    html += fmt::format(
        "<tr><td><a href=\"#{0}\">{0}</a></td><td>{1}</td><td class=\"number {2}\">{3}</td><td "
        "class=\"number\">{4}"
        "</td><td class=\"{2}\">{5}</td></tr>\n",
        escaped(row.result->name), escaped(reading.limit.measure.what), verdict,
        readable_value(reading.limit.measure, reading.value), limit_text(reading.limit),
        reading.good() ? "passed" : "MISSED");
  }
  return html + "</table>\n";
}

std::string images_html(const CheckResult& result) {
  std::string html;
  for (const CheckImage& image : result.images) {
    html += fmt::format("<h3>{}</h3>\n<div class=\"pictures\">\n", escaped(image.title));
    const std::pair<const char*, const cv::Mat*> three[] = {
        {"actual", &image.actual}, {"expected", &image.expected}, {"difference", &image.difference}};
    for (const auto& [what, pixels] : three) {
      html += fmt::format(
          "<figure><img loading=\"lazy\" alt=\"{0}\" src=\"{1}\"><figcaption>{0}</figcaption></figure>\n",
          what, data_uri(at_most_wide(*pixels, k_shown_width)));
    }
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
      "<!doctype html>\n"
      "<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>Limn checks</title>\n"
      "<style>{}</style>\n"
      "<h1>Limn checks: {}</h1>\n"
      "<p class=\"lead\">What the renderer drew ({}), compared with a ray tracer that shares no code with "
      "it. The readings that use most of their limit come first.</p>\n",
      k_check_style,
      failed == 0 ? fmt::format("all {} passed", results.size())
                  : fmt::format("{} of {} failed", failed, results.size()),
      escaped(renderer));
  html += table_html(results);
  for (const CheckResult& result : results) {
    html += fmt::format("<h2 id=\"{0}\">{0}</h2>\n<p class=\"lead\">{1} ({2:.1f} s)</p>\n",
                        escaped(result.name), escaped(result.about), result.seconds);
    html += images_html(result);
  }
  return write_file(path, html + "</html>\n");
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

}  // namespace limn::apps
