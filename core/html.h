#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

namespace limn {

/// Pieces of HTML pages that are one file: no scripts, no addresses of other files. Parameters named `html`
/// are inserted as they are; all other texts are escaped here.

/// `text` with <, >, & and quotes escaped, for HTML and XML, also inside attributes. Bytes that are not UTF-8
/// become U+FFFD.
std::string escaped(const std::string& text);

/// Which colours a page has: those of the reader's system, or always the same.
enum class HtmlColours { of_system, light, dark };

/// A whole page: title, the common style followed by `css`, and the body. The common style has the colours
/// --ground, --text, --faint, --line, --good, --doubt and --bad, and the classes lead, number, good, doubt
/// and bad.
std::string html_page(const std::string& title,
                      HtmlColours colours,
                      const std::string& css,
                      const std::string& html_body);

/// A cell of a table.
struct HtmlCell {
  std::string html;
  std::string css_class;  ///< empty: none
  int columns = 1;        ///< how many columns it covers
};
using HtmlRow = std::vector<HtmlCell>;

/// A cell that shows `text`.
HtmlCell text_cell(const std::string& text, const std::string& css_class = "");

/// A table with a row of headings; without headings there is no such row.
std::string html_table(std::span<const HtmlCell> headings, std::span<const HtmlRow> rows);

/// A figure with a caption below: a bold title and a text.
std::string html_figure(const std::string& html, const std::string& title, const std::string& text);

/// The image inside the page, at most `width` pixels wide. `name` is what readers get who cannot see it.
std::string html_image(const cv::Mat& image, int width, const std::string& name);

}  // namespace limn
