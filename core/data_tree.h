#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace limn {

/// An entry of a YAML, JSON or XML file of another program: a text, a list or a map.
struct DataNode {
  enum class Kind { null, text, list, map };
  Kind kind = Kind::null;
  std::string text;               ///< If it is a text: as it was written; numbers and truth values, too.
  std::vector<DataNode> items;    ///< If it is a list or a map.
  std::vector<std::string> keys;  ///< If it is a map: the key of each item, in the order of the file.
  int line = 0;                   ///< Line in a YAML file, from 1; 0: unknown.

  bool is_text() const { return kind == Kind::text; }
  bool is_list() const { return kind == Kind::list; }
  bool is_map() const { return kind == Kind::map; }
  /// The item of a map with this key; null when there is none or this is no map. The first one, if the key is
  /// there twice.
  const DataNode* find(std::string_view key) const;
};

/// Reads a whole YAML, JSON or XML file; which one it is, is told from the first character. A byte order mark
/// and UTF-16 are understood. YAML may be OpenCV's ("%YAML:1.0") and may hold several documents: the first
/// one counts. Of XML, elements that are called "_" are the items of a list, the others those of a map;
/// attributes are left out. Error: damaged text (with its line), aliases, or entries nested more than 64
/// deep.
Result<DataNode> parse_data(std::string_view text);

/// A number as programs write it ("1.", "+2e-3", OpenCV's ".Nan" and "-.Inf"); nullopt for another text.
std::optional<double> number_in(std::string_view text);

/// All numbers below the node in the order of the file, whether as a list (of lists), or as a text with
/// blanks or commas between them. Nullopt when there is something else.
std::optional<std::vector<double>> numbers_in(const DataNode& node);

}  // namespace limn
