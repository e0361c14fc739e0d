#include "validate/demo_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "core/file.h"
#include "core/html.h"
#include "core/image_io.h"

namespace limn::apps {
namespace {

constexpr int k_embedded_width = 1280;

constexpr const char* k_demo_style = R"(
:root { color-scheme: dark; }
body { margin: 0 auto; max-width: 1320px; padding: 2rem 1.5rem 4rem; background: #14161a; color: #e8e6e1;
       font: 16px/1.5 system-ui, sans-serif; }
h1 { font-weight: 600; margin: 0 0 .3rem; } .lead { color: #a9a69f; margin: 0 0 2rem; max-width: 46rem; }
table { border-collapse: collapse; margin: 0 0 2.5rem; } th { text-align: left; color: #a9a69f; font-weight: 500; }
td, th { padding: .35rem 1.6rem .35rem 0; border-bottom: 1px solid #2b2f36; }
td.value { font-variant-numeric: tabular-nums; text-align: right; } .good { color: #7fd1a0; } .bad { color: #ff9a7a; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(34rem, 1fr)); gap: 1.6rem; }
figure { margin: 0; } img { width: 100%; display: block; border-radius: 4px; background: #000; }
figcaption { margin-top: .5rem; color: #a9a69f; } figcaption b { color: #e8e6e1; }
)";

std::string rows_html(const std::vector<DemoRow>& rows) {
  std::string html = "<table><tr><th>measured</th><th>value</th><th>limit</th></tr>\n";
  for (const DemoRow& row : rows) {
    const char* colour = row.limit.empty() ? "" : row.good ? " good" : " bad";
    html += fmt::format("<tr><td>{}</td><td class=\"value{}\">{}</td><td>{}</td></tr>\n", escaped(row.what),
                        colour, escaped(row.value), escaped(row.limit));
  }
  return html + "</table>\n";
}

}  // namespace

Status write_demo_page(const DemoPage& page, const std::filesystem::path& path) {
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>Limn demo</title>\n<style>{}</style>\n<h1>Limn</h1>\n<p "
      "class=\"lead\">{}</p>\n",
      k_demo_style, escaped(page.headline));
  html += rows_html(page.rows) + "<div class=\"pictures\">\n";
  for (const DemoImage& image : page.images) {
    html +=
        fmt::format("<figure><img alt=\"{}\" src=\"{}\"><figcaption><b>{}.</b> {}</figcaption></figure>\n",
                    escaped(image.title), data_uri(at_most_wide(image.image, k_embedded_width)),
                    escaped(image.title), escaped(image.caption));
  }
  return write_file(path, html + "</div></html>\n");
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

}  // namespace limn::apps
