#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "tracker/refine.h"

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

/// Refines a quad whose code is known where edges lie too near to each other for EdgeRefiner: blur wider than
/// the cells leave room for, white margins of a pixel. Each side's surroundings are fitted as what they are:
/// background, margin, border and the first rows of cells, all seen through one Gaussian blur (also that of a
/// motion across the side), in a light that changes linearly along the side; unknown are the side's line,
/// blur, margin and levels. nullopt when a side's pixels do not settle them or contradict the model. `light`
/// is the light of a grey level.
std::optional<RefinedQuad> fit_pattern(const cv::Mat& grey,
                                       const std::array<double, 256>& light,
                                       const RefinedQuad& start,
                                       const SeenCells& cells);

}  // namespace limn::tracker
