#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

namespace limn::tracker {

/// The black and white cells of a code as the quad shows them, border included. Rows start at the side
/// between corners 0 and 1, columns at corner 0.
struct SeenCells {
  static constexpr std::size_t k_max = 9;
  int count = 0;  ///< cells along a side
  std::array<std::uint8_t, k_max * k_max> white{};

  bool is_white(int row, int column) const {
    return white[static_cast<std::size_t>(row) * static_cast<std::size_t>(count) +
                 static_cast<std::size_t>(column)] != 0;
  }
};

/// How a pattern appears in the image. Levels are linear light. Those of paper and ink are planes over the
/// marker, with coordinates from -1 to 1 along both of its axes (value in the middle, rise to the right, rise
/// downwards).
struct Appearance {
  double log_blur = 0;                               ///< logarithm of the Gaussian's sigma in px
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();  ///< motion blur during the exposure, px
  Eigen::Vector3d paper = Eigen::Vector3d::Zero(), ink = Eigen::Vector3d::Zero();
  Eigen::Vector4d ground = Eigen::Vector4d::Zero();  ///< light behind the paper, by side
  Eigen::Vector4d margin = Eigen::Vector4d::Zero();  ///< width of the white margin at each side, cells
  Eigen::Vector4d bend = Eigen::Vector4d::Zero();    ///< bend of the paper (pattern_kernels.h)

  double contrast() const { return paper[0] - ink[0]; }
};

/// A fitted pattern, from which the fit in the next image can start.
struct PatternAppearance {
  SeenCells cells;
  std::size_t first_corner = 0;  ///< which of the quad's corners is the marker's own top left
  Appearance look;               ///< in the newest image
  // From the last fit that did not start from a known appearance:
  double misfit = 0;       ///< mean square residual, relative to the contrast's square
  double explained = 0;    ///< share of the pixels that agree with the model
  double correlation = 1;  ///< the corners' variance over that for independent pixel errors
  int age = 0;             ///< images since then
  int kept_for = 0;        ///< after this many images the full fit is repeated
};

}  // namespace limn::tracker
