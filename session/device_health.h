#pragma once

#include <mutex>
#include <string>
#include <vector>

namespace limn::session {

/// The state of one device of a session.
struct DeviceState {
  std::string name;
  std::string kind;  ///< camera, projector, screen, keys
  bool works = true;
  std::string why = {};    ///< why it does not work; may be empty
  std::size_t images = 0;  ///< taken or shown so far
};

/// Keeps track of which devices work. Safe from several threads, except for add().
class DeviceHealth {
 public:
  /// Adds a device; returns its number for the other calls.
  std::size_t add(DeviceState device);

  /// The device captured or showed an image.
  void works(std::size_t device);
  /// The device failed; `why` may be empty.
  void fails(std::size_t device, const std::string& why);
  /// Adds another message for people.
  void note(const std::string& what);

  std::vector<DeviceState> all() const;
  /// The messages since the last call: devices that failed or work again (each change once), and notes.
  std::vector<std::string> take_messages();

 private:
  mutable std::mutex mutex_;
  std::vector<DeviceState> devices_;
  std::vector<std::string> messages_;
};

}  // namespace limn::session
