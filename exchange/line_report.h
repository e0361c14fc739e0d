#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "exchange/curves/named_curve.h"

namespace limn::exchange {

/// A line that was written, for people and for limn.lines/1.
struct LineRow {
  std::string name;
  std::string from;  ///< "the scene", "the last session", "look NAME", or the file that it is in now.
  std::vector<NamedCurve> curves = {};
};

/// Prints what was written to `file`: a sentence for each line, or limn.lines/1.
void print_lines(const std::vector<LineRow>& lines, const std::filesystem::path& file, bool is_json);

}  // namespace limn::exchange
