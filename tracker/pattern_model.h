#pragma once

#include <Eigen/Core>
#include <array>

#include "tracker/pattern_fit.h"

/// What pattern_fit fits: the light of a code's pixels and its derivatives by all that is unknown.
namespace limn::tracker::pattern {

/// How far pixels blur the cells at a place: sigmas along rows and columns, in cells, and their correlation
/// where the view is skewed.
struct CellBlur {
  double x, y, correlation;
};

/// The share of ink at a place, and its derivatives.
struct Ink {
  double value = 0, by_x = 0, by_y = 0, by_log_blur = 0;
};

/// A code's cells on endless paper.
class Pattern {
 public:
  explicit Pattern(const SeenCells& cells);
  int count() const { return count_; }

  /// By the bivariate normal's first terms in its correlation (tetrachoric series, Pearson 1900).
  Ink at(double x, double y, const CellBlur& blur) const;

 private:
  static constexpr int k_row = SeenCells::k_max + 2;
  int count_;
  std::array<double, static_cast<std::size_t>(k_row* k_row)> ink_{};
};

/// What is unknown. Levels are planes over the marker; margins (cells) and what is behind them one a side.
/// The first eight move the pattern: x += c0 + c1 x + c2 y + x (c6 x + c7 y), y += c3 + c4 x + c5 y + y (c6 x
/// + c7 y), with x and y from -1 to 1 over the marker: a small homography. Bent paper leaves the corners
/// where they are: x += b0 (1 - x^2) + b1 (1 - y^2), y += b2 (1 - x^2) + b3 (1 - y^2).
enum Unknown : int {
  shape = 0,
  log_blur = 8,
  motion_x,
  motion_y,
  paper,
  ink = paper + 3,
  ground = ink + 3,
  margin = ground + 4,
  bend = margin + 4,
  k_unknowns = bend + 4
};
using Vector = Eigen::Matrix<double, k_unknowns, 1>;

/// One guess of it all; motion in pixels.
struct State {
  std::array<Eigen::Vector2d, 4> corners;
  double log_blur = 0;  // sigma, px
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();
  Eigen::Vector3d paper = Eigen::Vector3d::Zero(), ink = Eigen::Vector3d::Zero();
  Eigen::Vector4d ground = Eigen::Vector4d::Zero(), margin = Eigen::Vector4d::Zero();
  Eigen::Vector4d bend = Eigen::Vector4d::Zero();
};

using Sample = PatternFitBuffers::Sample;

/// The model's light at pixels, and its derivatives.
class Model {
 public:
  Model(const Pattern& pattern, const State& state, bool has_ground);

  /// Whether light changes there.
  bool shows_edge(const Eigen::Vector2d& px) const;

  /// `behind` is the sample's share of what lies behind the paper.
  double at(const Sample& sample, Vector* derivative, double* behind) const;

 private:
  const Pattern& pattern_;
  const State& state_;
  const bool has_ground_;
  const int places_;
  Eigen::Matrix3d cells_from_px_;
  Eigen::Vector3d step_;  // of the whole motion, homogeneous
  double blur_px_;

  struct Ground {
    Eigen::Vector4d share = Eigen::Vector4d::Zero(), by_margin = Eigen::Vector4d::Zero();
    double by_log_blur = 0;
  };

  struct Place {
    Eigen::Vector3d p;  // homogeneous, in cells
    Eigen::Matrix2d cells_a_px;
    CellBlur blur;
  };

  Place place_of(const Eigen::Vector2d& px) const;

  void add_ground(
      double x, double y, const CellBlur& blur, double white, double* by_x, double* by_y, Ground* seen) const;
};

}  // namespace limn::tracker::pattern
