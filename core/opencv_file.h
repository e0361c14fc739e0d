#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn {

/// What stands at the top level of a file that cv::FileStorage wrote, by name: scalars and matrices; lists
/// and maps are left out. Read by ourselves because OpenCV 4.6 dies of some damaged files (XML whose tags do
/// not match, matrices whose size is no number).
class OpencvFile {
 public:
  struct Value {
    std::string text;             ///< of a scalar, without its quotes
    std::vector<double> numbers;  ///< of a matrix, row by row
    int rows = 0, cols = 0;
  };

  /// YAML, XML or JSON. Errors say the line, for a caller who knows the file.
  static Result<OpencvFile> parse(const std::string& text);

  /// Null when absent.
  const Value* find(const std::string& name) const;
  /// A whole number; nullopt when absent or something else.
  std::optional<int> integer(const std::string& name) const;

 private:
  std::map<std::string, Value> values_;
};

}  // namespace limn
