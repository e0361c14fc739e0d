#include "calib/report/svg_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/median.h"
#include "core/svg.h"

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

Svg image_plot(int width, int height) {
  const Vector2d low(-0.5, -0.5), size(width, height);
  Svg svg(low, size);
  svg.rect(low, size, "fill='#fff'");
  return svg;
}

void add_frame(int width, int height, Svg* svg) {
  svg->rect({-0.5, -0.5}, {static_cast<double>(width), static_cast<double>(height)},
            fmt::format("fill='none' stroke='{}' stroke-width='{:.1f}'", k_frame, width / 400.0));
}

// Grey cells where nothing was observed.
void add_empty_cells(int width, int height, const std::vector<FieldPoint>& points, Svg* svg) {
  std::array<bool, k_grid * k_grid> seen{};
  for (const FieldPoint& p : points) {
    const int x = std::clamp(static_cast<int>((p.px.x() + 0.5) / width * k_grid), 0, k_grid - 1);
    const int y = std::clamp(static_cast<int>((p.px.y() + 0.5) / height * k_grid), 0, k_grid - 1);
    seen[static_cast<size_t>(y * k_grid + x)] = true;
  }
  const Vector2d cell = Vector2d(width, height) / k_grid;
  svg->begin_group(fmt::format("fill='{}'", k_empty));
  for (int i = 0; i < k_grid * k_grid; ++i) {
    if (seen[static_cast<size_t>(i)]) continue;
    svg->rect(cell.cwiseProduct(Vector2d(i % k_grid, i / k_grid)) - Vector2d(0.5, 0.5), cell, "");
  }
  svg->end_group();
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

void add_arrow(const FieldPoint& p, double magnified, double most, int width, Svg* svg) {
  const double unit = width / 1000.0;
  if (p.outlier) {
    svg->circle(p.px, 6 * unit,
                fmt::format("fill='none' stroke='{}' stroke-width='{:.1f}'", k_ink, 1.8 * unit));
    return;
  }
  const std::string colour = colour_at(p.residual.norm() / most);
  Vector2d shift = p.residual.allFinite() ? Vector2d(magnified * p.residual) : Vector2d::Zero();
  if (shift.norm() > k_longest * width) shift *= k_longest * width / shift.norm();
  svg->line(p.px, p.px + shift, fmt::format("stroke='{}'", colour));
  svg->circle(p.px, 2.2 * unit, fmt::format("fill='{}'", colour));
}

}  // namespace

SvgPlot residual_field(int width, int height, const std::vector<FieldPoint>& points) {
  const double usual = usual_length(points);
  const double magnified = usual > 0 ? round_magnification(k_long * width / usual) : 1;
  const double most = usual > 0 ? 1.5 * usual : 1;
  Svg svg = image_plot(width, height);
  add_empty_cells(width, height, points, &svg);
  svg.begin_group(fmt::format("stroke-width='{:.2f}' stroke-linecap='round'", 1.6 * width / 1000.0));
  const size_t step = points.size() / k_most_arrows + 1;
  std::vector<FieldPoint> outliers;  // drawn on top
  for (size_t i = 0; i < points.size(); i += points[i].outlier ? 1 : step) {
    if (points[i].outlier)
      outliers.push_back(points[i]);
    else
      add_arrow(points[i], magnified, most, width, &svg);
  }
  for (const FieldPoint& p : outliers) add_arrow(p, magnified, most, width, &svg);
  svg.end_group();
  add_frame(width, height, &svg);
  std::string key = fmt::format(
      "Arrows magnified {:.0f} times, from blue (0) to red ({:.2g} px and more); grey: "
      "nothing observed",
      magnified, most);
  if (!outliers.empty()) key += "; black rings: outliers";
  if (step > 1) key += fmt::format("; one of {} drawn", step);
  return {svg.element(), key};
}

std::string dot_map(int width, int height, const std::vector<Dot>& dots, double most) {
  Svg svg = image_plot(width, height);
  const size_t step = dots.size() / k_most_arrows + 1;
  for (size_t i = 0; i < dots.size(); i += step)
    svg.circle(dots[i].px, 5 * width / 1000.0, fmt::format("fill='{}'", colour_at(dots[i].value / most)));
  add_frame(width, height, &svg);
  return svg.element();
}

std::string heat_map(int width, int height, int columns, const std::vector<double>& values, double most) {
  Svg svg = image_plot(width, height);
  const int rows = static_cast<int>(values.size()) / std::max(columns, 1);
  const double w = static_cast<double>(width) / columns, h = static_cast<double>(height) / std::max(rows, 1);
  for (size_t i = 0; i < values.size(); ++i) {
    const int column = static_cast<int>(i) % columns, row = static_cast<int>(i) / columns;
    svg.rect({column * w - 0.5, row * h - 0.5}, {w + 0.5, h + 0.5},
             fmt::format("fill='{}'", colour_at(values[i] / most)),
             std::isfinite(values[i]) ? fmt::format("{:.2f} mm", values[i]) : "");
  }
  add_frame(width, height, &svg);
  return svg.element();
}

std::string colour_key(double most, const std::string& unit) {
  Svg svg({0, 0}, {320, 34}, "class='key'");
  constexpr int k_steps = 40;
  for (int i = 0; i < k_steps; ++i)
    svg.rect({8.0 * i, 0}, {8.5, 12}, fmt::format("fill='{}'", colour_at((i + 0.5) / k_steps)));
  for (const double share : {0.0, 0.5, 1.0}) {
    const char* anchor = share == 0 ? "start" : share == 1 ? "end" : "middle";
    svg.text({320 * share, 29}, fmt::format("{:.2g} {}", most * share, unit),
             fmt::format("font-size='13' fill='{}' text-anchor='{}'", k_soft, anchor));
  }
  return svg.element();
}

std::string bar_chart(const std::vector<Bar>& bars, double limit, const std::string& limit_note) {
  constexpr double k_row = 26, k_from = 130, k_wide = 420, k_right = 150;
  double most = limit * 1.05;
  for (const Bar& bar : bars) most = std::max(most, bar.value);
  const double height = k_row * static_cast<double>(bars.size()) + 24;
  Svg svg({0, 0}, {k_from + k_wide + k_right, height}, "class='bars' font-size='13'");
  double y = 4;
  for (const Bar& bar : bars) {
    const double length = std::isfinite(bar.value) ? std::max(1.0, bar.value / most * k_wide) : k_wide;
    svg.text({k_from - 10, y + 14}, bar.label, fmt::format("text-anchor='end' fill='{}'", k_ink));
    svg.rect({k_from, y}, {length, 18}, fmt::format("rx='2' fill='{}'", colour_at(bar.value / limit * 0.8)));
    svg.text({k_from + length + 8, y + 14}, bar.note, fmt::format("fill='{}'", k_soft));
    y += k_row;
  }
  const double x = k_from + limit / most * k_wide;
  svg.line({x, 0}, {x, height - 18}, fmt::format("stroke='{}' stroke-dasharray='4 3'", k_soft));
  svg.text({x, height - 4}, limit_note, fmt::format("fill='{}' text-anchor='middle'", k_soft));
  return svg.element();
}

std::string sparkline(const std::vector<double>& values) {
  double most = 0;
  for (const double v : values) most = std::isfinite(v) ? std::max(most, v) : most;
  std::vector<Vector2d> points;
  const double last = std::max<double>(1, static_cast<double>(values.size()) - 1);
  for (size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) continue;
    points.emplace_back(8 + 284.0 * static_cast<double>(i) / last,
                        52 - 44 * (most > 0 ? values[i] / most : 0));
  }
  Svg svg({0, 0}, {300, 60}, "class='spark'");
  svg.line({0, 52}, {300, 52}, fmt::format("stroke='{}'", k_frame));
  svg.polyline(points, fmt::format("fill='none' stroke='{}' stroke-width='1.5'", colour_at(0)));
  for (const Vector2d& p : points) svg.circle(p, 3, fmt::format("fill='{}'", colour_at(0)));
  return svg.element();
}

}  // namespace limn::calib
