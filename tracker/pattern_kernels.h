#pragma once

#include <cstddef>
#include <cstdint>

/// The inner loops of pattern_model: plain numbers, so that pattern_light.cpp can be compiled once for every
/// kind of processor without a template or inline function that the others share.
namespace limn::tracker::pattern {

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

/// Samples are taken by so many: what is read and written reaches to the next multiple.
inline constexpr std::size_t k_together = 16;

/// One guess of all that is unknown, and the pattern.
struct Guess {
  static constexpr int k_max_cells = 9;
  static constexpr int k_row = k_max_cells + 2;
  int cells, places;  ///< a side; that stand for the motion
  bool has_ground;
  float cells_from_px[9], step[3];  ///< by rows; the whole motion, homogeneous
  float blur_px, half;              ///< half: of a cell, where the marker is 2 wide
  float paper[3], black[3], behind[4], margin[4], bends[4];
  float is_ink[k_row * k_row];  ///< 0 or 1, with the paper around
};

/// Pixels from the origin that cells_from_px has, and the places of the levels' planes.
struct Places {
  const float *x, *y, *level_x, *level_y;
};

/// Where results go. Derivatives that nobody wants may share a column.
struct Results {
  float *light, *behind;  ///< behind: the sample's share of what lies behind the paper
  float* derivatives[k_unknowns];
};

struct PatternKernels {
  void (*see)(const Guess&, const Places&, std::size_t count, const Results&);
  /// Where light changes: not 0 there.
  void (*find_edges)(const Guess&, const float* x, const float* y, std::size_t count, std::int32_t* shows);
};

/// How many versions this processor can run, at least 1.
int pattern_kernel_versions();

/// Version 0 runs on any processor, the last one is the fastest.
const PatternKernels& pattern_kernels(int version);

}  // namespace limn::tracker::pattern
