#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace limn {

// Order statistics. Those that take a pointer change the order of the values and copy nothing; a value is
// always one of the given, but for `mean_median`.

/// The value that `rank` others come before (0: the least). `values` has begin() and end(); rank < its size.
template <class Values>
auto value_of_rank(Values* values, std::size_t rank) {
  const auto at = values->begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

/// The middle of the values (the upper one of an even number), in their unit; `when_none` without any.
template <class Value>
Value median(std::vector<Value> values, Value when_none = 0) {
  return values.empty() ? when_none : value_of_rank(&values, values.size() / 2);
}

/// The middle of the values; of an even number the mean of the two in the middle. At least one value; by
/// value, so also of a std::array.
template <class Values>
auto mean_median(Values values) {
  const auto upper = value_of_rank(&values, values.size() / 2);
  if (values.size() % 2 == 1) return upper;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  return (*std::max_element(values.begin(), middle) + upper) / 2;
}

/// The value that a share (0 … 1) of the others come before; `when_none` without any.
template <class Value>
Value quantile(std::vector<Value> values, double share, Value when_none = 0) {
  return values.empty()
             ? when_none
             : value_of_rank(&values,
                             static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

}  // namespace limn
