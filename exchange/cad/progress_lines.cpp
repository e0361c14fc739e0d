#include "exchange/cad/progress_lines.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

namespace limn::cad {

void ProgressLines::begin_stage(const std::string& what, double from, double to) {
  what_ = what;
  from_ = from;
  to_ = to;
  printed_ = -1;
  advance(0);
}

void ProgressLines::advance(double share) {
  const int percent = static_cast<int>(from_ + (to_ - from_) * std::clamp(share, 0.0, 1.0));
  if (percent <= printed_ || descriptor_ < 0) return;
  printed_ = percent;
  const std::string line = fmt::format("progress {} {}\n", percent, what_);
  // Nobody needs a line that could not be written.
  if (::write(descriptor_, line.data(), line.size()) < 0) descriptor_ = -1;
}

void ProgressLines::Show(const Message_ProgressScope& /*scope*/, Standard_Boolean /*is_forced*/) {
  advance(GetPosition());
}

}  // namespace limn::cad
