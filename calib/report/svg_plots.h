#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace limn::calib {

/// Plots as SVG texts for white pages, without scripts, style sheets or addresses. Deterministic.

/// An observation in an imager's image and its residual.
struct FieldPoint {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  ///< px; not finite: drawn as a point
  bool outlier = false;
};

/// A plot and its legend.
struct SvgPlot {
  std::string svg;
  std::string key;  ///< "arrows x200; blue 0 to red 0.15 px; black rings: outliers"; plain text
};

/// Residuals as magnified arrows, coloured by their length, on a grid whose empty cells (nothing observed)
/// are grey. The magnification is the largest round number at which nine of ten inliers stay short.
SvgPlot residual_field(int width, int height, const std::vector<FieldPoint>& points);

/// A measured value at a pixel.
struct Dot {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double value = 0;
};
/// Values as coloured dots in an image; the colours range from 0 to `most`.
std::string dot_map(int width, int height, const std::vector<Dot>& dots, double most);

/// Cells, row by row, in an image's shape; NaN is grey. The colours range from 0 to `most`.
std::string heat_map(int width, int height, int columns, const std::vector<double>& values, double most);

/// The colour scale from 0 to `most`, with `unit`.
std::string colour_key(double most, const std::string& unit);

struct Bar {
  std::string label;
  double value = 0;
  std::string note;  ///< text behind the bar
};
/// Horizontal bars from 0 with a dashed line at `limit`.
std::string bar_chart(const std::vector<Bar>& bars, double limit, const std::string& limit_note);

/// Values over time, oldest first, on a scale from 0 to the largest.
std::string sparkline(const std::vector<double>& values);

}  // namespace limn::calib
