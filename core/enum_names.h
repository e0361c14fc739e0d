#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace limn {

/// The names of an enum's values in files and on the command line, in the order of the enumerators, which
/// count from 0.
template <class Enum, std::size_t Count>
struct EnumNames {
  std::array<std::string_view, Count> names;

  std::string text(Enum value) const { return std::string(names.at(static_cast<std::size_t>(value))); }
  /// The value of that name; nullopt when there is none.
  std::optional<Enum> find(std::string_view name) const {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) return std::nullopt;
    return static_cast<Enum>(found - names.begin());
  }
  /// The value that a ConfigNode names; records a problem for other names and returns the first value.
  template <class Node>
  Enum read(const Node& node) const {
    return find(node.choice(all())).value_or(Enum{});
  }
  std::vector<std::string> all() const { return {names.begin(), names.end()}; }
};

}  // namespace limn
