#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "core/lens.h"
#include "tracker/candidates.h"

namespace limn::tracker {

/// What a grey level says about light.
enum class Encoding {
  linear,  ///< proportional to it: machine-vision cameras
  srgb     ///< the sRGB curve: webcams, photographs
};

enum class Effort {
  rough,  ///< some rows of each side, once: good to a tenth of a pixel, for reading the cells
  full
};

/// What the rows of a side show.
enum class Sides {
  whole,
  covered  ///< something may lie over a part: a straight line along most of what is seen
};

/// A quad whose corners are the intersections of its sub-pixel edge lines.
struct RefinedQuad {
  std::array<Eigen::Vector2d, 4> corners_px;
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  /// Grey levels on both sides of each edge (of the side from corner i to i + 1), averaged along it.
  std::array<double, 4> outside_level, inside_level;
  /// How wide each side's edge is, as the sigma of a Gaussian, pixels.
  std::array<double, 4> blur_px;
  /// False when another edge stood so near to one of a side's that their blur overlaps: corners may be off.
  bool separate = true;
  /// Whether both sides are seen next to the corner.
  std::array<bool, 4> corner_visible;
};

/// Finds where each side's edge crosses the rows (steep sides) or columns (flat sides) of the raw image and
/// fits its line. A crossing is the centroid of the grey differences along the row. For the image of a
/// straight edge that pixels of square shape and any symmetric blur have averaged, that centroid is exact at
/// any phase and slope (the sampled first moment of a function that was twice averaged over a pixel has no
/// aliasing), which crossings of a middle level are not. With a lens the side is straight in undistorted
/// directions: the bow that the lens gives it is taken off before the line is fitted. Holds its buffers
/// between calls.
class EdgeRefiner {
 public:
  /// Centroids are taken in linear light: a pixel half covered by ink is no middle level of an encoded
  /// image.
  explicit EdgeRefiner(Encoding encoding = Encoding::linear);

  /// nullopt when a side shows no edge from light outside to dark inside of at least `min_contrast` levels.
  std::optional<RefinedQuad> refine(const cv::Mat& grey,
                                    const Quad& quad,
                                    double min_contrast,
                                    const Lens* lens,
                                    Effort effort = Effort::full,
                                    Sides sides = Sides::whole);

  /// Light of a grey level, 0 ... 255.
  const std::array<double, 256>& light() const { return light_; }

 private:
  struct Row {  // across a side's main axis
    int u, centre;
  };
  struct Crossings {               // of rows that show the edge
    std::vector<double> u, v;      // v(u) across the side's main axis
    std::vector<double> share;     // of the side's contrast, at most 1: the inverse of its relative deviation
    std::vector<double> d;         // u less the line's u_middle
    std::vector<double> residual;  // distance from the line, times share

    void clear() { u.clear(), v.clear(), share.clear(); }
    void add(double at_u, double at_v, double its_share) {
      u.push_back(at_u), v.push_back(at_v), share.push_back(its_share);
    }
  };
  std::array<double, 256> light_;  // of a grey level, 0 ... 255
  std::vector<Row> rows_;
  Crossings crossings_;
  std::vector<double> gradients_;  // of all rows, reach_ * 2 each
  std::vector<float> deviations_;  // scratch of the robust scale

 public:
  /// A side's line v = offset + slope * d + curvature * d^2, d = u - u_middle, in the raw image less the
  /// lens's bow. Bent paper and a lens that is not given show as curvature; it is 0 where the crossings show
  /// none, and grows steadily with the evidence.
  struct EdgeLine {
    bool flat = true;  ///< u is x and v is y; otherwise the other way round
    double u_middle = 0;
    double offset = 0, slope = 0, curvature = 0;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of (offset, slope, curvature)
    double correlation = 1;  ///< variance over that of crossings with an error each of its own
    double outside_level = 0, inside_level = 0;
    double blur_px = 0;
    bool separate = true;                           ///< no other edge within the edge's blur
    bool seen_at_start = true, seen_at_end = true;  ///< next to the side's corners

    double at(double u) const {
      const double d = u - u_middle;
      return offset + d * (slope + d * curvature);
    }
    double slope_at(double u) const { return slope + 2 * curvature * (u - u_middle); }
    /// Variance of at(u).
    double variance(double u) const {
      const double d = u - u_middle;
      const Eigen::Vector3d row(1, d, d * d);
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
  bool fit_line(Effort effort, Sides sides, EdgeLine* line, double* variance);
  void find_ends(double from, double to, double trim, double variance, EdgeLine* line) const;
  double correlation_along(const EdgeLine& line, double variance) const;
  double fit_terms(int terms, bool from_line, EdgeLine* line);
  void find_consensus(EdgeLine* line);
};

}  // namespace limn::tracker
