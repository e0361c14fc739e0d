#pragma once

#include <cstdint>
#include <string>

#include "core/frame.h"

namespace limn::nodes {

/// Converts the stamps of a camera of ROS 2, which are of the wall clock of the machine that sent them, to
/// the session's clock. A stamp counts if it lies at most 2 s before the arrival and after the previous
/// image's. Otherwise the arrival counts: without a word where the stamp is at most 20 ms later, as by clocks
/// that are synchronised; else with a problem.
class RosClock {
 public:
  /// `wall_at_zero_ns`: this machine's wall clock, in ns since 1970, when the session's clock is zero.
  Stamp captured_at(std::int32_t s, std::uint32_t ns, Stamp arrived_at, std::int64_t wall_at_zero_ns);
  /// How the first stamp that did not count is wrong; empty: all counted so far.
  const std::string& problem() const { return problem_; }

 private:
  Stamp captured_at_ = Stamp::min();
  std::string problem_;
};

/// That of the present.
std::int64_t wall_at_zero_ns();

}  // namespace limn::nodes
