#include "session/device_health.h"

#include <utility>

namespace limn::session {

std::size_t DeviceHealth::add(DeviceState device) {
  devices_.push_back(std::move(device));
  return devices_.size() - 1;
}

void DeviceHealth::works(std::size_t device) {
  const std::lock_guard lock(mutex_);
  DeviceState& state = devices_.at(device);
  if (!state.works) messages_.push_back(state.name + " is back");
  state.works = true;
  state.why.clear();
  ++state.images;
}

void DeviceHealth::fails(std::size_t device, const std::string& why) {
  const std::lock_guard lock(mutex_);
  DeviceState& state = devices_.at(device);
  if (state.works)
    messages_.push_back(state.name + " is gone; the session goes on without it" +
                        (why.empty() ? "" : ": " + why));
  state.works = false;
  state.why = why;
}

void DeviceHealth::note(const std::string& what) {
  const std::lock_guard lock(mutex_);
  messages_.push_back(what);
}

std::vector<DeviceState> DeviceHealth::all() const {
  const std::lock_guard lock(mutex_);
  return devices_;
}

std::vector<std::string> DeviceHealth::take_messages() {
  const std::lock_guard lock(mutex_);
  return std::exchange(messages_, {});
}

}  // namespace limn::session
