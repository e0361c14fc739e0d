#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

namespace limn::tracker {

/// The black and white cells of a code as the quad shows them, border included: rows from the side between
/// corners 0 and 1, columns from corner 0.
struct SeenCells {
  static constexpr int k_max = 9;
  int count = 0;  ///< a side
  std::array<std::uint8_t, k_max * k_max> white{};

  bool is_white(int row, int column) const {
    return white[static_cast<std::size_t>(row * count + column)] != 0;
  }
};

/// How a pattern looks in its place. Levels are of light: planes over the marker, from -1 to 1 along both of
/// its axes (value in the middle, rise to the right, rise downwards).
struct Appearance {
  double log_blur = 0;                               ///< of the Gaussian's sigma, px
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();  ///< while the image was taken, px
  Eigen::Vector3d paper = Eigen::Vector3d::Zero(), ink = Eigen::Vector3d::Zero();
  Eigen::Vector4d ground = Eigen::Vector4d::Zero();  ///< light behind the paper, by side
  Eigen::Vector4d margin = Eigen::Vector4d::Zero();  ///< white beside each side, cells
  Eigen::Vector4d bend = Eigen::Vector4d::Zero();    ///< of the paper (pattern_light.h)

  double contrast() const { return paper[0] - ink[0]; }
};

/// A pattern that was fitted, from which a fit to the next image can start.
struct PatternAppearance {
  SeenCells cells;
  std::size_t first_corner = 0;  ///< which of the quad's corners is the marker's own top left
  Appearance look;               ///< as seen last
  // Of the last fit that started from nothing known:
  double misfit = 0;       ///< mean square residual, of the contrast's square
  double explained = 0;    ///< share of the pixels that agree with the model
  double correlation = 1;  ///< of the corners' variance over that of pixels with an error each of their own
  int age = 0;             ///< images since
  int kept_for = 0;        ///< images
};

}  // namespace limn::tracker
