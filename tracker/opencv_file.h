#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::tracker {

/// The scalars and matrices at the top level of a file that cv::FileStorage wrote, by name; other entries
/// have no numbers and no text. It is read by parse_data, because OpenCV 4.6 crashes on some damaged files
/// (XML with tags that do not match, matrices with a size that is not a number).
class OpencvFile {
 public:
  struct Value {
    std::string text;             ///< The text of a scalar, without quotes.
    std::vector<double> numbers;  ///< The elements of a matrix, row by row.
    int rows = 0, cols = 0;
  };

  /// Reads YAML, XML or JSON. Error messages say the line; the caller adds the file's name.
  static Result<OpencvFile> parse(const std::string& text);

  /// Null when absent.
  const Value* find(const std::string& name) const;
  /// A whole number; nullopt when absent or something else.
  std::optional<int> integer(const std::string& name) const;

 private:
  std::map<std::string, Value> values_;
};

}  // namespace limn::tracker
