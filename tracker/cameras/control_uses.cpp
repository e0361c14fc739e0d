#include "tracker/cameras/control_uses.h"

#include <algorithm>
#include <utility>

namespace limn::tracker {
namespace {

constexpr double k_once_s = 0.4;  // gestures of two cameras within this time are one use
constexpr int k_most_uses = 8;    // at once; more are a mistake of the camera's machine

}  // namespace

std::vector<ControlUse> ControlUses::read(std::size_t camera, const CameraDetections& found) {
  Camera& state = cameras_[camera];
  std::vector<ControlUse> out;
  if (found.controls.size() != state.controls.size()) return out;
  const bool is_counted_on = std::exchange(state.run, found.run) == found.run;
  const auto before = std::exchange(state.controls, found.controls);
  for (std::size_t i = 0; i < before.size() && is_counted_on; ++i) {
    const int forward = found.controls[i].forward - before[i].forward;
    const int backward = found.controls[i].backward - before[i].backward;
    if ((forward <= 0 && backward <= 0) || !is_use(state, found, i)) continue;
    used_at_[i] = found.captured_at;
    for (int use = 0; use < std::min(forward, k_most_uses); ++use) out.push_back({i, 1});
    for (int use = 0; use < std::min(backward, k_most_uses); ++use) out.push_back({i, -1});
  }
  return out;
}

bool ControlUses::is_use(const Camera& seen_by, const CameraDetections& found, std::size_t control) const {
  const GestureReading& reading = found.controls[control];
  const bool is_seen_elsewhere =
      !reading.is_seen && std::any_of(cameras_.begin(), cameras_.end(), [&](const Camera& other) {
        return &other != &seen_by && other.controls[control].is_seen;
      });
  const bool is_arms = std::ranges::any_of(found.controls, [&](const GestureReading& other) {
    return reading.hidden_since && other.hidden_since > reading.hidden_since;
  });
  const Stamp used_at = used_at_[control];
  const bool is_known = used_at != Stamp{} && seconds_between(used_at, found.captured_at) < k_once_s;
  return !is_seen_elsewhere && !is_arms && !is_known;
}

}  // namespace limn::tracker
