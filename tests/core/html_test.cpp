#include "core/html.h"

#include <gtest/gtest.h>

#include "core/svg.h"

namespace limn {
namespace {

TEST(Html, EscapesWhatWouldEndATextOrAnAttribute) {
  EXPECT_EQ(escaped("a<b> & \"c\" 'd'"), "a&lt;b&gt; &amp; &quot;c&quot; &#39;d&#39;");
}

TEST(Html, ATableHasItsHeadingsAndCells) {
  const HtmlRow headings = {text_cell("what"), text_cell("mm", "number")};
  const std::vector<HtmlRow> rows = {{text_cell("<left>"), text_cell("0.1", "number bad")},
                                     {{"<b>all</b>", "", 2}}};
  EXPECT_EQ(html_table(headings, rows),
            "<table>\n<tr><th>what</th><th class=\"number\">mm</th></tr>\n"
            "<tr><td>&lt;left&gt;</td><td class=\"number bad\">0.1</td></tr>\n"
            "<tr><td colspan=\"2\"><b>all</b></td></tr>\n</table>\n");
  EXPECT_EQ(html_table({}, rows).find("<th"), std::string::npos);
}

TEST(Html, APageEscapesItsTitleAndKeepsItsBody) {
  const std::string page = html_page("A & B", HtmlColours::of_system, "p { margin: 0; }", "<p>text</p>");
  EXPECT_NE(page.find("<title>A &amp; B</title>"), std::string::npos);
  EXPECT_NE(page.find("p { margin: 0; }"), std::string::npos);
  EXPECT_NE(page.find("<p>text</p>"), std::string::npos);
  EXPECT_NE(page.find("prefers-color-scheme: dark"), std::string::npos);
  EXPECT_EQ(html_page("", HtmlColours::light, "", "").find("prefers-color-scheme"), std::string::npos);
}

TEST(Html, AnImageIsEmbeddedAndMadeNoWider) {
  const cv::Mat image(40, 80, CV_8UC3, cv::Scalar(10, 20, 30));
  const std::string small = html_image(image, 80, "a \"wall\""), smaller = html_image(image, 20, "wall");
  EXPECT_NE(small.find("alt=\"a &quot;wall&quot;\" src=\"data:image/"), std::string::npos);
  EXPECT_LT(smaller.size(), small.size());
}

TEST(Svg, ShapesLieInTheOrderTheyWereDrawn) {
  Svg svg({-0.5, 0}, {20, 10}, "class='plot'");
  svg.rect({1, 2}, {3, 4}, "fill='#fff'", "5 < 6");
  svg.begin_group("stroke='red'");
  svg.line({0, 0}, {1.25, 1}, "");
  svg.circle({2, 2}, 1, "");
  svg.end_group();
  const std::vector<Eigen::Vector2d> points = {{0, 0}, {1, 0}, {1, 1}};
  svg.polyline(points, "");
  svg.polygon(points, "class='a'");
  svg.text({3, 4}, "a & b", "");
  EXPECT_EQ(
      svg.element(),
      "<svg viewBox='-0.5 0 20 10' role='img' class='plot'>"
      "<rect x='1.0' y='2.0' width='3.0' height='4.0' fill='#fff'><title>5 &lt; 6</title></rect>"
      "<g stroke='red'><line x1='0.0' y1='0.0' x2='1.2' y2='1.0' /><circle cx='2.0' cy='2.0' r='1.0' /></g>"
      "<polyline points='0.0,0.0 1.0,0.0 1.0,1.0' />"
      "<polygon points='0.0,0.0 1.0,0.0 1.0,1.0' class='a'/>"
      "<text x='3.0' y='4.0' >a &amp; b</text></svg>");
}

}  // namespace
}  // namespace limn
