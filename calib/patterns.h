#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::calib {

/// Pictures that follow each other and together light every pixel alike.
struct PatternGroup {
  int first = 0;
  int count = 2;
};

/// Pictures for a projector from which each of its pixels can be told apart. The one code so far is Gray code
/// with inverses, in OpenCV's order: the columns' bits, then the rows', most significant first, each picture
/// followed by its inverse; white and black last.
struct Patterns {
  std::string code = "gray";
  int width = 0;
  int height = 0;

  /// Of a known code for a size of 2 to 16384 pixels a side.
  static Result<Patterns> create(const std::string& code, int width, int height);

  int column_bits() const;  ///< ceil(log2(width))
  int row_bits() const;     ///< ceil(log2(height))
  int count() const { return 2 * (column_bits() + row_bits()) + 2; }
  int white() const { return count() - 2; }
  int black() const { return count() - 1; }
  /// Each picture with its inverse, in their order; white and black are the last group.
  std::vector<PatternGroup> groups() const;

  /// Picture number `index`, 8-bit grey, 0 or 255, of the projector's size.
  cv::Mat picture(int index) const;
  bool operator==(const Patterns&) const = default;
};

/// The codes that exist, for messages: "gray".
std::vector<std::string> pattern_codes();

/// `000.png` and so on: the name of a picture's file.
std::string picture_name(int index);

/// patterns.json: {"schema": "limn.patterns/1", "code": "gray", "size": [width, height], "pictures": 44}; the
/// pictures are 000.png … in the order above.
Status save_patterns(const Patterns& patterns, const std::filesystem::path& path);
Result<Patterns> load_patterns(const std::filesystem::path& path);

}  // namespace limn::calib
