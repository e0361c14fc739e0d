#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/enum_names.h"
#include "core/lens.h"
#include "tracker/candidates.h"

namespace limn::tracker {

/// How a grey level relates to light.
enum class Encoding {
  linear,  ///< proportional to light: machine-vision cameras
  srgb     ///< the sRGB curve: webcams, photographs
};
/// Their names for users.
inline constexpr EnumNames<Encoding, 2> k_encodings{{"linear", "srgb"}};

enum class Effort {
  rough,  ///< some rows of each side, one round: good to a tenth of a pixel, enough to read the cells
  full
};

/// Whether a side may be partly hidden.
enum class Sides {
  whole,
  covered  ///< something may cover a part: the line follows most of what is visible
};

/// A quad whose corners are the intersections of its sub-pixel edge lines.
struct RefinedQuad {
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  /// Grey levels on both sides of each edge (side i runs from corner i to i + 1), averaged along it.
  std::array<double, 4> outside_level{}, inside_level{};
  /// Width of each side's edge, as the sigma of a Gaussian in pixels.
  std::array<double, 4> blur_px{};
  /// False when another edge is so near to a side's that their blur overlaps: corners may be wrong.
  bool separate = true;
  /// Whether both sides are visible next to the corner.
  std::array<bool, 4> corner_visible{};
  /// Bow that opposite sides share, as a share of half their length: that of bent paper, and 0 where a shadow
  /// bends one side.
  double bow_share = 0;
};

/// Finds where each side's edge crosses the rows (steep sides) or columns (flat sides) of the raw image and
/// fits its line. A crossing is the centroid of the grey differences along the row. For a straight edge,
/// averaged over square pixels and blurred symmetrically, that centroid is exact at any phase and slope: the
/// sampled first moment of a function that was averaged twice over a pixel has no aliasing. Crossings of a
/// middle grey level are not exact. With a lens, the side is straight in undistorted directions: the
/// curvature that the lens gives it is subtracted before the line is fitted. Holds its buffers between calls.
class EdgeRefiner {
 public:
  /// Centroids are computed in linear light, because a pixel half covered by ink does not have the middle
  /// level of an encoded image. `is_inverted`: the image's levels are 255 minus the camera's.
  explicit EdgeRefiner(Encoding encoding = Encoding::linear, bool is_inverted = false);

  /// nullopt when a side has no edge from light outside to dark inside of at least `min_contrast` levels.
  std::optional<RefinedQuad> refine(const cv::Mat& grey,
                                    const Quad& quad,
                                    double min_contrast,
                                    const Lens* lens,
                                    Effort effort = Effort::full,
                                    Sides sides = Sides::whole);

  /// Light of a grey level, 0 ... 255.
  const std::array<double, 256>& light() const { return light_; }

 private:
  struct Row {  // across the main axis of a side
    int u, centre;
  };
  struct Crossings {           // for the rows that show the edge
    std::vector<double> u, v;  // the edge's position v across the main axis, at u
    // Share of the side's contrast, at most 1: the inverse of the crossing's relative deviation.
    std::vector<double> share;
    std::vector<double> d;         // u - u_middle of the line
    std::vector<double> residual;  // distance from the line, times share

    void clear() { u.clear(), v.clear(), share.clear(); }
    void add(double at_u, double at_v, double its_share) {
      u.push_back(at_u), v.push_back(at_v), share.push_back(its_share);
    }
  };
  std::array<double, 256> light_;  // light of each grey level, 0 ... 255
  std::vector<Row> rows_;
  Crossings crossings_;
  std::vector<double> gradients_;  // two times the reach for each row
  std::vector<float> deviations_;  // scratch memory of the robust scale

 public:
  /// The line of a side, v = offset + slope * d + curvature * d^2 + third * d^3 + fourth * d^4,
  /// d = u - u_middle, in the raw image without the lens's curvature. Curvature comes from bent paper or from
  /// a lens that is not given; the higher terms come from paper that is bent strongly. They are 0 where the
  /// crossings do not show them and grow steadily with the evidence.
  struct EdgeLine {
    using Terms = Eigen::Matrix<double, 5, 1>;
    bool flat = true;  ///< true: u is x and v is y; false: u is y and v is x
    double u_middle = 0;
    double half = 0;  ///< half the length of the crossings, along u
    double offset = 0, slope = 0, curvature = 0, third = 0, fourth = 0;
    /// Covariance of the five terms, offset first.
    Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();
    Terms bent_terms = Terms::Zero();  ///< terms of the fit with curvature, where the curvature is clear
    bool is_curved =
        false;  ///< this side or the opposite one bends strongly: terms of third and fourth order are fitted
    double correlation = 1;  ///< the variance over that for independent crossings
    double outside_level = 0, inside_level = 0;
    double blur_px = 0;
    bool separate = true;  ///< no other edge lies within the edge's blur
    /// Whether the edge is visible next to the side's corners.
    bool seen_at_start = true, seen_at_end = true;

    double at(double u) const {
      const double d = u - u_middle;
      return offset + d * (slope + d * (curvature + d * (third + d * fourth)));
    }
    double slope_at(double u) const {
      const double d = u - u_middle;
      return slope + d * (2 * curvature + d * (3 * third + d * 4 * fourth));
    }
    Terms terms() const { return {offset, slope, curvature, third, fourth}; }
    /// The bow of the quadratic term between the ends and the middle, px.
    double bow_px() const { return std::abs(curvature) * half * half; }
    /// The same, as a share of half the length.
    double bow_share() const { return std::abs(curvature) * half; }
    /// Variance of at(u).
    double variance(double u) const {
      const double d = u - u_middle;
      Terms row;
      row << 1, d, d * d, d * d * d, d * d * d * d;
      return row.dot(covariance * row);
    }
  };

 private:
  bool fit_side(const cv::Mat& grey,
                const std::array<Eigen::Vector2d, 4>& corners,
                std::size_t side,
                double reach_px,
                double min_contrast,
                const Lens* lens,
                Effort effort,
                Sides sides,
                const EdgeLine* before,
                EdgeLine* line);
  void settle_shares(Effort effort);
  bool fit_line(Effort effort, Sides sides, bool is_curved, EdgeLine* line, double* variance);
  void find_ends(double from, double to, double trim, double variance, EdgeLine* line) const;
  double correlation_along(const EdgeLine& line, double variance) const;
  double fit_terms(int terms, bool from_line, EdgeLine* line);
  bool fit_curve(double* variance, EdgeLine* line);
  void find_consensus(EdgeLine* line);
};

}  // namespace limn::tracker
