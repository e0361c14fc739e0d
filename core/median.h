#pragma once

#include <algorithm>
#include <vector>

namespace limn {

/// The middle of the values (the upper one of an even number), in their unit; 0 for none.
template <class Value>
Value median(std::vector<Value> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace limn
