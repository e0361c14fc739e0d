#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace limn {

// Order statistics. Functions that take a pointer reorder the values in place and copy nothing. The result is
// always one of the given values, except for `mean_median`.

/// The value with `rank` others before it in sorted order (rank 0 is the smallest). `values` has begin() and
/// end(); rank must be less than its size.
template <class Values>
auto value_of_rank(Values* values, std::size_t rank) {
  const auto at = values->begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

/// The median (of an even number of values, the upper one of the two in the middle); `when_none` if there are
/// no values.
template <class Value>
Value median(std::vector<Value> values, Value when_none = 0) {
  return values.empty() ? when_none : value_of_rank(&values, values.size() / 2);
}

/// The median (of an even number of values, the mean of the two in the middle). There must be at least one
/// value. The argument is copied, so a std::array works, too.
template <class Values>
auto mean_median(Values values) {
  const auto upper = value_of_rank(&values, values.size() / 2);
  if (values.size() % 2 == 1) return upper;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  return (*std::max_element(values.begin(), middle) + upper) / 2;
}

/// The quantile at `share` (0 … 1): the value with that share of the others before it in sorted order;
/// `when_none` if there are no values.
template <class Value>
Value quantile(std::vector<Value> values, double share, Value when_none = 0) {
  return values.empty()
             ? when_none
             : value_of_rank(&values,
                             static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

}  // namespace limn
