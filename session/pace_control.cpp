#include "session/pace_control.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/median.h"
#include "core/scale_resolution.h"

namespace limn::session {
namespace {

// A decision is made on the median of so many frames, or of as many as were made in this time.
constexpr std::size_t k_frames = 10, k_least_frames = 3;
constexpr double k_decision_s = 1;
constexpr std::size_t k_skipped = 3;  // frames after a change that do not count
// A rise is tried when its frames are expected to take at most this share of the period; between this and the
// whole period nothing changes.
constexpr double k_spare = 0.8;
constexpr double k_least_wait_s = 2, k_most_wait_s = 120;
constexpr double k_regret_s = 10;  // a rise that is taken back within this time was wrong

}  // namespace

std::vector<Effort> efforts_for(const Rig& rig, bool may_resize) {
  constexpr sim::TraceEffort k_medium{.edge_samples = 8, .lamp_points = 4},
      k_low{.edge_samples = 4, .lamp_points = 1};
  std::vector<Effort> out = {{1, {}, 0}, {1, {}, 0.1}, {1, k_medium, 0.2}, {1, k_low, 0.3}};
  if (!may_resize) return out;
  for (const double share : {0.75, 0.5, 0.4, 0.3})
    if (Rig coarser = rig; scale_resolution(share, &coarser)) out.push_back({share, k_low, 0.3});
  return out;
}

double guessed_cost(const Effort& effort) {
  const double screen = effort.screen_interval_s > 0 ? 0 : 0.1;
  const double samples = 0.1 * effort.trace.edge_samples / 32 + 0.1 * effort.trace.lamp_points / 12;
  return effort.resolution * effort.resolution * (0.7 + samples) + screen;
}

std::string sentence(const Effort& effort) {
  if (effort == Effort{}) return {};
  std::vector<std::string> parts;
  if (effort.resolution < 1)
    parts.push_back(
        fmt::format("the virtual devices have {:.0f} % of their resolution", 100 * effort.resolution));
  if (effort.trace != sim::TraceEffort{})
    parts.push_back(fmt::format("edges in camera images have {} samples instead of {}",
                                effort.trace.edge_samples, sim::TraceEffort{}.edge_samples));
  if (effort.screen_interval_s > 0)
    parts.push_back(
        fmt::format("the screen changes at most {:.0f} times a second", 1 / effort.screen_interval_s));
  return fmt::format("So that this machine keeps real time, {}.{}", fmt::join(parts, ", "),
                     effort.resolution < 1 ? " --resolution 1 keeps the whole resolution." : "");
}

PaceControl::PaceControl(std::vector<double> costs, double period_s, std::size_t first)
    : costs_(std::move(costs)),
      period_s_(period_s),
      chosen_(std::min(first, costs_.size() - 1)),
      to_skip_(k_skipped),
      wait_s_(k_least_wait_s) {}

void PaceControl::forget_frames() {
  frames_.clear();
  passed_s_ = 0;
  to_skip_ = k_skipped;
}

bool PaceControl::choose(std::size_t index) {
  has_risen_ = index < chosen_;
  chosen_ = index;
  spare_s_ = since_rise_s_ = 0;
  forget_frames();
  return true;
}

// The first effort whose frames are expected to be in time, and at least the next one.
std::size_t PaceControl::fallen(double frame_s) const {
  std::size_t index = chosen_ + 1;
  while (index + 1 < costs_.size() && frame_s * costs_[index] / costs_[chosen_] > period_s_) ++index;
  return index;
}

bool PaceControl::add_frame(double busy_s) {
  if (to_skip_ > 0) {
    --to_skip_;
    return false;
  }
  frames_.push_back(busy_s);
  passed_s_ += std::max(busy_s, period_s_);
  if (frames_.size() < (passed_s_ < k_decision_s ? k_frames : k_least_frames)) return false;
  const double passed_s = std::exchange(passed_s_, 0);
  const double frame_s = median(std::exchange(frames_, {}));
  since_rise_s_ += passed_s;
  if (has_risen_ && since_rise_s_ > k_regret_s) {  // the rise was right
    has_risen_ = false;
    wait_s_ = k_least_wait_s;
  }
  if (frame_s > period_s_) {
    spare_s_ = 0;
    if (chosen_ + 1 == costs_.size()) return false;
    if (has_risen_) wait_s_ = std::min(4 * wait_s_, k_most_wait_s);
    return choose(fallen(frame_s));
  }
  const bool is_spare = chosen_ > 0 && frame_s * costs_[chosen_ - 1] / costs_[chosen_] <= k_spare * period_s_;
  spare_s_ = is_spare ? spare_s_ + passed_s : 0;
  return spare_s_ >= wait_s_ && choose(chosen_ - 1);
}

}  // namespace limn::session
