#pragma once

#include <cstddef>
#include <cstdint>

/// The inner loops of pattern_fit. They use plain numbers only, so that pattern_kernels.cpp can be compiled
/// once for every kind of processor without templates or inline functions that the versions would share.
namespace limn::tracker::pattern {

/// The unknowns. Levels are planes over the marker; there is one margin (cells) and one background level for
/// each side. The first eight move the pattern by a small homography: x += c0 + c1 x + c2 y + x (c6 x + c7
/// y), y += c3 + c4 x + c5 y + y (c6 x + c7 y), with x and y from -1 to 1 over the marker. Bent paper leaves
/// the corners where they are: x += b0 (1 - x^2) + b1 (1 - y^2), y += b2 (1 - x^2) + b3 (1 - y^2).
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

/// Samples are processed in groups of this many: memory is read and written up to the next multiple.
inline constexpr std::size_t k_together = 16;

/// The pattern and one estimate of all unknowns.
struct Guess {
  static constexpr int k_max_cells = 9;
  static constexpr int k_row = k_max_cells + 2;
  int cells, places;  ///< cells along a side; number of places along the motion
  bool has_ground;
  float cells_from_px[9], step[3];  ///< row by row; the whole motion in cells, homogeneous
  float blur_px, half;              ///< half: width of a cell in coordinates from -1 to 1
  float paper[3], black[3], behind[4], margin[4], bends[4];
  float is_ink[k_row * k_row];  ///< 0 or 1, with a ring of paper around
};

/// x, y: pixels relative to the origin of cells_from_px; level_x, level_y: places in the planes of levels.
struct Places {
  const float *x, *y, *level_x, *level_y;
};

/// Where results are written. Derivatives that are not needed may share a column.
struct Results {
  float *light, *behind;  ///< behind: the share of the background in each sample
  float* derivatives[k_unknowns];
};

struct PatternKernels {
  void (*evaluate)(const Guess&, const Places&, std::size_t count, const Results&);
  /// Sets shows[i] to a value other than 0 where the light of a pixel changes.
  void (*find_edges)(const Guess&, const float* x, const float* y, std::size_t count, std::int32_t* shows);
};

/// Number of versions that this processor can run, at least 1.
int pattern_kernel_versions();

/// Version 0 runs on any processor; the last one is the fastest.
const PatternKernels& pattern_kernels(int version);

}  // namespace limn::tracker::pattern
