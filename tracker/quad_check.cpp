#include "tracker/quad_check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>

#include "tracker/identify.h"
#include "tracker/quad_reader.h"
#include "tracker/quad_sampler.h"
#include "tracker/simd.h"

namespace limn::tracker {
namespace {

using identity::k_limits;
using identity::k_middle;

// The level at `rank` in ascending order. There are few levels, so all are compared with all.
LIMN_SIMD int level_of_rank(const std::uint8_t* levels, int count, int rank) {
  constexpr int k_lanes = 64;
  std::array<std::uint8_t, k_lanes> padded{}, smaller{};
  std::copy_n(levels, count, padded.begin());
  for (int i = 0; i < count; ++i) {
    const std::uint8_t level = levels[i];
    for (std::size_t k = 0; k < k_lanes; ++k)
      smaller[k] = static_cast<std::uint8_t>(smaller[k] + (level < padded[k] ? 1 : 0));
  }
  int highest = 0;
#pragma omp simd reduction(max : highest)
  for (std::size_t k = 0; k < k_lanes; ++k) {
    const int level = smaller[k] <= rank ? padded[k] : 0;
    highest = level > highest ? level : highest;
  }
  return highest;
}

// Levels of the nearest pixels at some places of a quad.
template <std::size_t count>
std::array<std::uint8_t, count> nearest_levels(const cv::Mat& grey,
                                               const Quad& quad,
                                               const std::array<std::array<float, count>, 2>& places) {
  std::array<std::uint8_t, count> levels;
  QuadSampler(grey, quad.corners_px).nearest(places[0], places[1], levels.data());
  return levels;
}

// The cells of a code, border included, read at one pixel each.
constexpr int k_most_coarse_side = 8;
struct CoarseCells {
  int count = 0;            // cells along a side, without the border
  bool has_border = false;  // whether the border is dark, but for some cells
  std::uint64_t code = 0;   // the first cell is the highest bit
};

CoarseCells coarse_cells(const cv::Mat& grey, const Quad& quad, int count) {
  constexpr std::size_t k_most = k_most_coarse_side * k_most_coarse_side;
  constexpr int k_most_light_border = 4;
  const auto side = static_cast<std::size_t>(count) + 2;
  std::array<std::array<float, k_most>, 2> at;
  for (std::size_t i = 0; i < side * side; ++i) {
    at[0][i] = (static_cast<float>(i % side) + 0.5F) / static_cast<float>(side);
    at[1][i] = (static_cast<float>(i / side) + 0.5F) / static_cast<float>(side);
  }
  std::array<std::uint8_t, k_most> levels, border;
  QuadSampler(grey, quad.corners_px)
      .nearest(std::span(at[0]).first(side * side), std::span(at[1]).first(side * side), levels.data());
  const auto is_border = [&](std::size_t i) {
    return i < side || i >= side * (side - 1) || i % side == 0 || i % side == side - 1;
  };
  int border_cells = 0;
  std::uint8_t lightest = 0;
  for (std::size_t i = 0; i < side * side; ++i)
    if (is_border(i))
      border[static_cast<std::size_t>(border_cells++)] = levels[i];
    else
      lightest = std::max(lightest, levels[i]);
  const int dark = level_of_rank(border.data(), border_cells, border_cells / 2);
  const double middle = dark + k_middle * (lightest - dark);
  CoarseCells cells{count};
  cells.has_border = std::count_if(border.begin(), border.begin() + border_cells,
                                   [&](int level) { return level > middle; }) <= k_most_light_border;
  for (std::size_t i = 0; i < side * side; ++i)
    if (!is_border(i)) cells.code = (cells.code << 1) | std::uint64_t{levels[i] > middle};
  return cells;
}

// Whether the sides are as different as those of a square that is tilted by 53 degrees, or more. Parts of
// other markers are.
bool is_elongated(const Quad& quad) {
  constexpr double k_most_ratio = 1 / 0.6;
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const double side = (quad.corners_px[(i + 1) % 4] - quad.corners_px[i]).norm();
    shortest = std::min(shortest, side), longest = std::max(longest, side);
  }
  return longest > k_most_ratio * shortest;
}

}  // namespace

bool may_be_marker(const cv::Mat& grey, const Quad& quad, double min_contrast, double border) {
  constexpr float k_inset = 0.07F;  // inside the border of every code (a ninth or more)
  constexpr double k_thin = 0.1;    // templates may have thinner ones, and are read in their middle
  constexpr std::size_t k_border = 20, k_inside = 25;
  static constexpr auto k_at = [] {
    std::array<std::array<float, k_border + k_inside>, 2> at{};
    std::size_t count = 0;
    const auto add = [&](float x, float y) { at[0][count] = x, at[1][count++] = y; };
    for (std::size_t i = 0; i < k_border / 4; ++i) {
      const float along = 0.1F + 0.2F * static_cast<float>(i);
      add(along, k_inset), add(along, 1 - k_inset), add(k_inset, along), add(1 - k_inset, along);
    }
    for (int row = 0; row < 5; ++row)
      for (int column = 0; column < 5; ++column)
        add(0.2F + 0.15F * static_cast<float>(column), 0.2F + 0.15F * static_cast<float>(row));
    return at;
  }();
  const auto at_thin_border = [&] {
    auto at = k_at;
    for (auto& coordinates : at)
      for (std::size_t i = 0; i < k_border; ++i) {
        if (coordinates[i] == k_inset) coordinates[i] = static_cast<float>(0.5 * border);
        if (coordinates[i] == 1 - k_inset) coordinates[i] = static_cast<float>(1 - 0.5 * border);
      }
    return at;
  };
  const auto levels =
      border < k_thin ? nearest_levels(grey, quad, at_thin_border()) : nearest_levels(grey, quad, k_at);
  const auto inside = levels.begin() + k_border;
  const int lightest = *std::max_element(inside, levels.end());
  const int middle = level_of_rank(levels.data(), k_border, k_border / 2);
  if (lightest - middle < min_contrast) return false;
  // Three quarters of the border must be darker than a limit halfway to the lightest inside.
  return level_of_rank(levels.data(), k_border, k_border * 3 / 4) < middle + 0.6 * (lightest - middle);
}

bool may_be_covered_code(const cv::Mat& grey, const Quad& quad) {
  constexpr std::size_t k_along = 10, k_border = 4 * k_along;
  constexpr int k_max_light = k_border * 7 / 40;  // codes with fingers, bites or slatted shadow have up to 5
  constexpr std::size_t k_cells = 6;
  // Smallest number of changes between neighbouring cells, of 60 pairs. Every code of the families that are
  // read when covered has at least 17, and a quarter may be hidden. Two or three edges through a quad make
  // 12.
  constexpr int k_min_changes = 13;
  static constexpr auto k_at = [] {
    std::array<std::array<float, k_border + k_cells * k_cells>, 2> at{};
    std::size_t count = 0;
    const auto add = [&](float x, float y) { at[0][count] = x, at[1][count++] = y; };
    for (std::size_t i = 0; i < k_along; ++i) {
      constexpr float k_inset = 1.0F / 16;
      const float along = k_inset + (1 - 2 * k_inset) * static_cast<float>(i) / (k_along - 1);
      add(along, k_inset), add(along, 1 - k_inset), add(k_inset, along), add(1 - k_inset, along);
    }
    const auto middle = [](std::size_t i) { return (static_cast<float>(i) + 1.5F) / (k_cells + 2); };
    for (std::size_t row = 0; row < k_cells; ++row)
      for (std::size_t column = 0; column < k_cells; ++column) add(middle(column), middle(row));
    return at;
  }();
  const auto levels = nearest_levels(grey, quad, k_at);
  const auto border = std::span(levels).first(k_border);
  const auto inside = std::span(levels).subspan(k_border);
  const double dark = level_of_rank(border.data(), k_border, k_border / 2);
  // The brightest may be glare.
  const double light = level_of_rank(inside.data(), static_cast<int>(inside.size()), 31);
  const double middle = dark + k_middle * (light - dark);
  if (std::count_if(border.begin(), border.end(), [&](int level) { return level > middle; }) > k_max_light)
    return false;
  return std::any_of(k_limits.begin(), k_limits.end(), [&](double share) {
    const double limit = dark + share * (light - dark);
    int changes = 0;
    for (std::size_t i = 0; i < inside.size(); ++i) {
      const bool is_light = inside[i] > limit;
      changes += i % k_cells != k_cells - 1 && is_light != (inside[i + 1] > limit);
      changes += i + k_cells < inside.size() && is_light != (inside[i + k_cells] > limit);
    }
    return changes >= k_min_changes;
  });
}

bool may_be_code_with_broken_side(const cv::Mat& grey, const Quad& quad, const Families& families) {
  constexpr int k_most_wrong = 2;
  if (is_elongated(quad)) return false;
  CoarseCells cells;
  return std::ranges::any_of(families.codes(), [&](const CodeFamily& family) {
    if (!can_have_broken_side(family) || family.cells + 2 > k_most_coarse_side) return false;
    if (family.cells != cells.count) cells = coarse_cells(grey, quad, family.cells);
    return cells.has_border && std::ranges::any_of(family.codes, [&](const auto& turns) {
             return std::ranges::any_of(
                 turns, [&](std::uint64_t turn) { return std::popcount(turn ^ cells.code) <= k_most_wrong; });
           });
  });
}

}  // namespace limn::tracker
