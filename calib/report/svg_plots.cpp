#include "calib/report/svg_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr int k_grid = 10;              // number of cells for coverage both ways, as in report.json
constexpr size_t k_most_arrows = 4000;  // in one plot; of more, every n-th is drawn
constexpr double k_long = 0.04;         // share of the width: nine of ten arrows stay below
constexpr double k_longest = 0.1;       // share of the width: longer arrows are cut

constexpr auto k_frame = "#cfd4da", k_empty = "#eceff2", k_ink = "#1d2329", k_soft = "#5d6670";

// Blue, teal, green, amber, red: dark enough on white, ordered by lightness and hue.
std::string colour_at(double share) {
  struct Colour {
    double r, g, b;
  };
  constexpr std::array<Colour, 5> k_stops = {
      {{38, 99, 178}, {27, 158, 160}, {116, 173, 62}, {236, 157, 20}, {205, 48, 56}}};
  if (!std::isfinite(share)) return k_empty;
  const double at = std::clamp(share, 0.0, 1.0) * (k_stops.size() - 1);
  const auto i = std::min(static_cast<size_t>(at), k_stops.size() - 2);
  const double t = at - static_cast<double>(i);
  const auto mix = [&](double a, double b) { return static_cast<int>(std::lround(a + t * (b - a))); };
  return fmt::format("#{:02x}{:02x}{:02x}", mix(k_stops[i].r, k_stops[i + 1].r),
                     mix(k_stops[i].g, k_stops[i + 1].g), mix(k_stops[i].b, k_stops[i + 1].b));
}

std::string opened(int width, int height) {
  return fmt::format(
      "<svg viewBox='-0.5 -0.5 {0} {1}' role='img'><rect x='-0.5' y='-0.5' width='{0}' "
      "height='{1}' fill='#fff'/>",
      width, height);
}

std::string framed(int width, int height) {
  return fmt::format(
      "<rect x='-0.5' y='-0.5' width='{}' height='{}' fill='none' stroke='{}' stroke-width='{:.1f}'/>", width,
      height, k_frame, width / 400.0);
}

// Grey cells where nothing was observed.
std::string bare_cells(int width, int height, const std::vector<FieldPoint>& points) {
  std::array<bool, k_grid * k_grid> seen{};
  for (const FieldPoint& p : points) {
    const int x = std::clamp(static_cast<int>((p.px.x() + 0.5) / width * k_grid), 0, k_grid - 1);
    const int y = std::clamp(static_cast<int>((p.px.y() + 0.5) / height * k_grid), 0, k_grid - 1);
    seen[static_cast<size_t>(y * k_grid + x)] = true;
  }
  std::string svg = fmt::format("<g fill='{}'>", k_empty);
  for (int i = 0; i < k_grid * k_grid; ++i) {
    if (seen[static_cast<size_t>(i)]) continue;
    svg += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}'/>",
                       i % k_grid * width / static_cast<double>(k_grid) - 0.5,
                       i / k_grid * height / static_cast<double>(k_grid) - 0.5,
                       width / static_cast<double>(k_grid), height / static_cast<double>(k_grid));
  }
  return svg + "</g>";
}

// The 90th percentile of the inliers' lengths.
double usual_length(const std::vector<FieldPoint>& points) {
  std::vector<double> lengths;
  for (const FieldPoint& p : points) {
    if (!p.outlier && p.residual.allFinite()) lengths.push_back(p.residual.norm());
  }
  if (lengths.empty()) return 0;
  return value_of_rank(&lengths, lengths.size() * 9 / 10);
}

double round_magnification(double wanted) {
  double best = 1;
  for (const double decade : {1, 10, 100, 1000, 10000}) {
    for (const double step : {1, 2, 5}) {
      if (decade * step <= wanted) best = decade * step;
    }
  }
  return best;
}

std::string arrow(const FieldPoint& p, double magnified, double most, int width) {
  const double unit = width / 1000.0;
  if (p.outlier)
    return fmt::format(
        "<circle cx='{:.1f}' cy='{:.1f}' r='{:.1f}' fill='none' stroke='{}' stroke-width='{:.1f}'/>",
        p.px.x(), p.px.y(), 6 * unit, k_ink, 1.8 * unit);
  const std::string colour = colour_at(p.residual.norm() / most);
  Vector2d shift = p.residual.allFinite() ? Vector2d(magnified * p.residual) : Vector2d::Zero();
  if (shift.norm() > k_longest * width) shift *= k_longest * width / shift.norm();
  return fmt::format(
      "<path d='M{:.1f} {:.1f}l{:.1f} {:.1f}' stroke='{}'/><circle cx='{:.1f}' cy='{:.1f}' "
      "r='{:.1f}' fill='{}'/>",
      p.px.x(), p.px.y(), shift.x(), shift.y(), colour, p.px.x(), p.px.y(), 2.2 * unit, colour);
}

}  // namespace

std::string xml_escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
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
      case '\'':
        out += "&#39;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

SvgPlot residual_field(int width, int height, const std::vector<FieldPoint>& points) {
  const double usual = usual_length(points);
  const double magnified = usual > 0 ? round_magnification(k_long * width / usual) : 1;
  const double most = usual > 0 ? 1.5 * usual : 1;
  std::string svg = opened(width, height) + bare_cells(width, height, points) +
                    fmt::format("<g stroke-width='{:.2f}' stroke-linecap='round'>", 1.6 * width / 1000.0);
  const size_t step = points.size() / k_most_arrows + 1;
  std::string outliers;  // drawn on top
  bool any_outlier = false;
  for (size_t i = 0; i < points.size(); i += points[i].outlier ? 1 : step) {
    (points[i].outlier ? outliers : svg) += arrow(points[i], magnified, most, width);
    any_outlier = any_outlier || points[i].outlier;
  }
  svg += outliers + "</g>" + framed(width, height) + "</svg>";
  std::string key = fmt::format(
      "Arrows magnified {:.0f} times, from blue (0) to red ({:.2g} px and more); grey: "
      "nothing observed",
      magnified, most);
  if (any_outlier) key += "; black rings: outliers";
  if (step > 1) key += fmt::format("; one of {} drawn", step);
  return {svg, key};
}

std::string dot_map(int width, int height, const std::vector<Dot>& dots, double most) {
  std::string svg = opened(width, height);
  const size_t step = dots.size() / k_most_arrows + 1;
  for (size_t i = 0; i < dots.size(); i += step)
    svg += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='{:.1f}' fill='{}'/>", dots[i].px.x(),
                       dots[i].px.y(), 5 * width / 1000.0, colour_at(dots[i].value / most));
  return svg + framed(width, height) + "</svg>";
}

std::string heat_map(int width, int height, int columns, const std::vector<double>& values, double most) {
  std::string svg = opened(width, height);
  const int rows = static_cast<int>(values.size()) / std::max(columns, 1);
  const double w = static_cast<double>(width) / columns, h = static_cast<double>(height) / std::max(rows, 1);
  for (size_t i = 0; i < values.size(); ++i) {
    const int column = static_cast<int>(i) % columns, row = static_cast<int>(i) / columns;
    svg += fmt::format("<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='{}'>",
                       column * w - 0.5, row * h - 0.5, w + 0.5, h + 0.5, colour_at(values[i] / most));
    if (std::isfinite(values[i])) svg += fmt::format("<title>{:.2f} mm</title>", values[i]);
    svg += "</rect>";
  }
  return svg + framed(width, height) + "</svg>";
}

std::string colour_key(double most, const std::string& unit) {
  std::string svg = "<svg class='key' viewBox='0 0 320 34' role='img'>";
  constexpr int k_steps = 40;
  for (int i = 0; i < k_steps; ++i)
    svg += fmt::format("<rect x='{:.1f}' y='0' width='8.5' height='12' fill='{}'/>", 8.0 * i,
                       colour_at((i + 0.5) / k_steps));
  for (const double share : {0.0, 0.5, 1.0})
    svg += fmt::format("<text x='{:.0f}' y='29' font-size='13' fill='{}' text-anchor='{}'>{:.2g} {}</text>",
                       320 * share, k_soft,
                       share == 0   ? "start"
                       : share == 1 ? "end"
                                    : "middle",
                       most * share, xml_escaped(unit));
  return svg + "</svg>";
}

std::string bar_chart(const std::vector<Bar>& bars, double limit, const std::string& limit_note) {
  constexpr double k_row = 26, k_from = 130, k_wide = 420, k_right = 150;
  double most = limit * 1.05;
  for (const Bar& bar : bars) most = std::max(most, bar.value);
  const double height = k_row * static_cast<double>(bars.size()) + 24;
  std::string svg = fmt::format("<svg class='bars' viewBox='0 0 {} {}' role='img' font-size='13'>",
                                k_from + k_wide + k_right, height);
  double y = 4;
  for (const Bar& bar : bars) {
    const double length = std::isfinite(bar.value) ? std::max(1.0, bar.value / most * k_wide) : k_wide;
    svg += fmt::format("<text x='{}' y='{:.0f}' text-anchor='end' fill='{}'>{}</text>", k_from - 10, y + 14,
                       k_ink, xml_escaped(bar.label));
    svg += fmt::format("<rect x='{}' y='{:.0f}' width='{:.1f}' height='18' rx='2' fill='{}'/>", k_from, y,
                       length, colour_at(bar.value / limit * 0.8));
    svg += fmt::format("<text x='{:.1f}' y='{:.0f}' fill='{}'>{}</text>", k_from + length + 8, y + 14, k_soft,
                       xml_escaped(bar.note));
    y += k_row;
  }
  const double x = k_from + limit / most * k_wide;
  svg += fmt::format(
      "<path d='M{0:.1f} 0V{1:.0f}' stroke='{2}' stroke-dasharray='4 3'/><text x='{0:.1f}' "
      "y='{3:.0f}' fill='{2}' text-anchor='middle'>{4}</text>",
      x, height - 18, k_soft, height - 4, xml_escaped(limit_note));
  return svg + "</svg>";
}

std::string sparkline(const std::vector<double>& values) {
  double most = 0;
  for (const double v : values) most = std::isfinite(v) ? std::max(most, v) : most;
  std::string path, dots;
  for (size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    const double x =
        8 + 284.0 * static_cast<double>(i) / std::max<double>(1, static_cast<double>(values.size()) - 1);
    const double y = 52 - 44 * (most > 0 ? values[i] / most : 0);
    path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x, y);
    dots += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3' fill='{}'/>", x, y, colour_at(0));
  }
  return fmt::format(
      "<svg class='spark' viewBox='0 0 300 60' role='img'><path d='M0 52H300' stroke='{}'/>"
      "<path d='{}' fill='none' stroke='{}' stroke-width='1.5'/>{}</svg>",
      k_frame, path, colour_at(0), dots);
}

}  // namespace limn::calib
