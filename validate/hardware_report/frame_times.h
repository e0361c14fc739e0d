#pragma once

#include <string>
#include <vector>

#include "core/frame.h"

namespace limn::validate {

/// When a frame was captured, and when the program had it.
struct FrameTime {
  Stamp captured_at, arrived_at;
};

/// How evenly a camera's frames come.
struct FrameRhythm {
  int frames = 0;
  double period_s = 0;   ///< median distance of two stamps
  double jitter_s = 0;   ///< 95 % of the distances differ from the median by at most this
  double longest_s = 0;  ///< longest distance
  int missing = 0;       ///< frames that are missing in between, by the stamps
  double delay_s = 0;    ///< median time from the stamp to the arrival
};

/// Fewer than two frames: all zeros but `frames`.
FrameRhythm frame_rhythm(const std::vector<FrameTime>& times);

/// Sentences about what is odd and what to do; empty: nothing is.
std::vector<std::string> odd_in(const FrameRhythm& rhythm);

/// As a table: captured_at_s and arrived_at_s, from the first stamp on.
std::string frame_times_csv(const std::vector<FrameTime>& times);

}  // namespace limn::validate
