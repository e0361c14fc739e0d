#include "core/html.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "core/utf8.h"

namespace limn {
namespace {

constexpr const char* k_light =
    "color-scheme: light; --ground: #fbfaf8; --text: #1d1f23; --faint: #6b6862; --line: #dddad3; "
    "--good: #17683c; --doubt: #8a5a00; --bad: #b3261e;";
constexpr const char* k_dark =
    "color-scheme: dark; --ground: #14161a; --text: #e8e6e1; --faint: #a9a69f; --line: #2b2f36; "
    "--good: #7fd1a0; --doubt: #f5b642; --bad: #ff9a7a;";

constexpr const char* k_common_style = R"(
body { margin: 0 auto; max-width: 1320px; padding: 2rem 1.5rem 4rem; background: var(--ground); color: var(--text);
       font: 16px/1.5 system-ui, sans-serif; }
h1 { font-weight: 600; margin: 0 0 .3rem; } h2 { font-weight: 600; margin: 2.5rem 0 .2rem; }
h3 { font-weight: 500; font-size: 1rem; margin: 1.4rem 0 .3rem; }
.lead { color: var(--faint); margin: 0 0 1.5rem; max-width: 50rem; }
table { border-collapse: collapse; } th { text-align: left; color: var(--faint); font-weight: 500; }
td, th { padding: .3rem 1.4rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
.number { font-variant-numeric: tabular-nums; text-align: right; white-space: nowrap; }
.good { color: var(--good); } .doubt { color: var(--doubt); } .bad { color: var(--bad); }
figure { margin: 0; } img { width: 100%; display: block; border-radius: 4px; background: #000; }
figcaption { margin-top: .4rem; color: var(--faint); } figcaption b { color: var(--text); }
)";

std::string colour_style(HtmlColours colours) {
  const char* first = colours == HtmlColours::dark ? k_dark : k_light;
  std::string css = fmt::format("\n:root {{ {} }}", first);
  if (colours == HtmlColours::of_system)
    css += fmt::format("\n@media (prefers-color-scheme: dark) {{ :root {{ {} }} }}", k_dark);
  return css;
}

std::string row_html(std::span<const HtmlCell> cells, const char* tag) {
  std::string html = "<tr>";
  for (const HtmlCell& cell : cells) {
    html += fmt::format("<{}", tag);
    if (!cell.css_class.empty()) html += fmt::format(" class=\"{}\"", escaped(cell.css_class));
    if (cell.columns > 1) html += fmt::format(" colspan=\"{}\"", cell.columns);
    html += fmt::format(">{}</{}>", cell.html, tag);
  }
  return html + "</tr>\n";
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : as_utf8(text)) {
    switch (c) {
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '&':
        html += "&amp;";
        break;
      case '\'':
        html += "&#39;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string html_page(const std::string& title,
                      HtmlColours colours,
                      const std::string& css,
                      const std::string& html_body) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><title>{}</title>\n<style>{}{}{}</style></"
      "head><body>\n{}"
      "</body></html>\n",
      escaped(title), colour_style(colours), k_common_style, css, html_body);
}

HtmlCell text_cell(const std::string& text, const std::string& css_class) {
  return {escaped(text), css_class};
}

std::string html_table(std::span<const HtmlCell> headings, std::span<const HtmlRow> rows) {
  std::string html = "<table>\n";
  if (!headings.empty()) html += row_html(headings, "th");
  for (const HtmlRow& row : rows) html += row_html(row, "td");
  return html + "</table>\n";
}

std::string html_figure(const std::string& html, const std::string& title, const std::string& text) {
  return fmt::format("<figure>{}<figcaption><b>{}</b> {}</figcaption></figure>\n", html, escaped(title),
                     escaped(text));
}

std::string html_image(const cv::Mat& image, int width, const std::string& name) {
  cv::Mat scaled = image;
  if (image.cols > width)
    cv::resize(image, scaled, {width, image.rows * width / image.cols}, 0, 0, cv::INTER_AREA);
  return fmt::format("<img loading=\"lazy\" alt=\"{}\" src=\"{}\">", escaped(name), data_uri(scaled));
}

}  // namespace limn
