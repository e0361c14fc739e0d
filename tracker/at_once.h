#pragma once

#include <opencv2/core/utility.hpp>

namespace limn::tracker {

/// Calls work(i), i = 0 ... count - 1, at once where there are threads: of OpenCV's pool.
template <typename Work>
void at_once(int count, int threads, const Work& work) {
  if (threads == 1 || count == 1)
    for (int i = 0; i < count; ++i) work(i);
  else
    cv::parallel_for_(
        cv::Range(0, count),
        [&](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i) work(i);
        },
        count);
}

}  // namespace limn::tracker
