#include "validate/demo_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/file.h"
#include "core/html.h"

namespace limn::validate {
namespace {

constexpr int k_embedded_width = 1280;

constexpr const char* k_demo_style = R"(
table { margin: 0 0 2.5rem; }
.images { display: grid; grid-template-columns: repeat(auto-fit, minmax(34rem, 1fr)); gap: 1.6rem; }
)";

std::string rows_html(const std::vector<DemoRow>& rows) {
  const HtmlRow headings = {text_cell("measured"), text_cell("value"), text_cell("limit")};
  std::vector<HtmlRow> cells;
  for (const DemoRow& row : rows) {
    const char* colour = row.limit.empty() ? "number" : row.good ? "number good" : "number bad";
    cells.push_back({text_cell(row.what), text_cell(row.value, colour), text_cell(row.limit)});
  }
  return html_table(headings, cells);
}

}  // namespace

Status write_demo_page(const DemoPage& page, const std::filesystem::path& path) {
  std::string html = fmt::format("<h1>Limn</h1>\n<p class=\"lead\">{}</p>\n", escaped(page.headline));
  html += rows_html(page.rows) + "<div class=\"images\">\n";
  for (const DemoImage& image : page.images)
    html +=
        html_figure(html_image(image.image, k_embedded_width, image.title), image.title + ".", image.caption);
  return write_file(path, html_page("Limn demo", HtmlColours::dark, k_demo_style, html + "</div>\n"));
}

std::string text_table(const std::vector<DemoRow>& rows) {
  std::size_t what_width = 0, value_width = 0;
  for (const DemoRow& row : rows) {
    what_width = std::max(what_width, row.what.size());
    value_width = std::max(value_width, row.value.size());
  }
  std::string text;
  for (const DemoRow& row : rows) {
    const std::string limit =
        row.limit.empty() ? "" : fmt::format("  ({}{})", row.limit, row.good ? "" : ", MISSED");
    text += fmt::format("{:<{}}  {:>{}}{}\n", row.what, what_width, row.value, value_width, limit);
  }
  return text;
}

}  // namespace limn::validate
