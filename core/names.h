#pragma once

#include <algorithm>
#include <concepts>
#include <iterator>
#include <string>
#include <string_view>

namespace limn {

/// A list of names for a sentence: "left, right"; `when_none` for an empty list. The items are strings or
/// have a member `name`.
template <class Items>
std::string joined_names(const Items& items, std::string_view when_none = "none") {
  std::string list;
  for (const auto& item : items) {
    if (!list.empty()) list += ", ";
    if constexpr (std::convertible_to<decltype(item), std::string_view>)
      list += std::string_view(item);
    else
      list += std::string_view(item.name);
  }
  return list.empty() ? std::string(when_none) : list;
}

/// The first item with this `name`; null when there is none.
template <class Items>
auto* find_named(Items& items, std::string_view name) {
  const auto found =
      std::find_if(std::begin(items), std::end(items), [&](const auto& item) { return item.name == name; });
  return found == std::end(items) ? nullptr : &*found;
}

}  // namespace limn
