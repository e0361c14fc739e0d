#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/code/patterns.h"
#include "core/result.h"

namespace limn::calib {

/// Where the images of white and of black are in a series.
enum class WhitePlace {
  absent,
  white_black_first,
  black_white_first,
  white_black_last,
  black_white_last,
  white_first_black_last,
  black_first_white_last
};

/// Where the inverse of each Gray-code pattern is.
enum class InversePlace {
  none,
  second,  ///< directly after the pattern
  first,   ///< directly before it
  behind,  ///< all inverses of the series after all patterns
  before   ///< all inverses of the series before all patterns
};

/// Which axes a series shows, in this order.
enum class AxisOrder { columns_rows, rows_columns, columns, rows };

/// The order in which a program stores the images of a Gray code. The default is OpenCV's.
struct ShotOrder {
  WhitePlace white = WhitePlace::white_black_last;
  InversePlace inverses = InversePlace::second;
  AxisOrder axes = AxisOrder::columns_rows;
  bool finest_first = false;  ///< the narrowest stripes of each axis come first
  int step_px = 1;            ///< width of the narrowest stripes, projector pixels

  bool has_white() const { return white != WhitePlace::absent; }
  bool operator==(const ShotOrder&) const = default;
};

/// "white and black last; each pattern, then its inverse; columns, then rows; widest stripes first"
std::string to_text(const ShotOrder& order);

/// What a person says about the order; what is absent is found in the images.
struct KnownOrder {
  std::optional<std::string> white;  ///< white-first, black-first, white-last or no-white
  std::optional<InversePlace> inverses;
  std::optional<AxisOrder> axes;
  std::optional<bool> finest_first;
  std::optional<int> step_px;
  std::string text;  ///< as entered, for messages

  /// Parses words separated by commas: white-first, black-first, white-last, no-white; inverse-first,
  /// inverse-second, inverses-behind, inverses-before, no-inverses; columns-first, rows-first, columns-only,
  /// rows-only; widest-first, finest-first. Other words are a usage error that lists these.
  static Result<KnownOrder> parse(const std::string& words);
};

/// An order and what follows from it.
struct FoundOrder {
  ShotOrder order;
  Patterns patterns;
  /// For each image of `patterns`: the index of the stored image; -1 for white and black that are absent.
  std::vector<int> shots;
  bool is_assumed = false;       ///< the images show too little to find the order; OpenCV's is assumed
  bool is_step_assumed = false;  ///< several steps explain the images; the smallest power of two is taken
};

/// Numbers of images that a Gray code for a projector of that size can have, the most usual first.
std::vector<int> gray_code_counts(int projector_width, int projector_height, const KnownOrder& known = {});

/// Finds which pattern each image of a series shows. `series`: series of one and the same order, all with the
/// same number of images, in the order of their names. Every order with that number of images that `known`
/// allows is tested on lines of pixels over all series: white is bright everywhere and black dark, a pattern
/// and its inverse are complementary, and wherever one bit changes between two neighbouring pixels, the finer
/// bits have the values at which Gray code changes that bit. Rows and columns are told apart by the number of
/// bits, by codes that the projector does not have, and by the directions in which they grow: a projection
/// that is mirrored and also turned is less likely than the other order.
/// Errors: no order has that number of images; none fits the images, or only one that `known` excludes.
Result<FoundOrder> find_shot_order(const std::vector<std::vector<std::filesystem::path>>& series,
                                   int projector_width,
                                   int projector_height,
                                   const KnownOrder& known = {});

}  // namespace limn::calib
