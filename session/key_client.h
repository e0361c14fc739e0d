#pragma once

#include <vector>

#include "device/key_source.h"
#include "session/device_health.h"
#include "session/requests/keys.h"
#include "session/session_client.h"

namespace limn::session {

/// Sends the key presses of clickers, pedals and keyboards to a session as edits.
class KeyClient final : public SessionClient {
 public:
  /// `keys`: key bindings and chosen slot, shared with the operator console; null: own ones.
  KeyClient(std::vector<device::KeySource>& sources,
            const scene::Scene& scene,
            Keys* keys,
            DeviceHealth* health);

  void apply_edits(const SessionMoment& moment) override;
  void publish_state(const SessionMoment&) override {}

 private:
  struct Source {
    device::KeySource* keys;
    std::size_t number;  // in health_
    bool is_gone = false;
  };
  void edit(int key, const Source& source, const SessionMoment& moment);

  Keys own_;
  Keys* keys_;
  DeviceHealth* health_;
  std::vector<Source> sources_;
};

}  // namespace limn::session
