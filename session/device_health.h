#pragma once

#include <mutex>
#include <string>
#include <vector>

namespace limn::apps {

/// How a device of a session is.
struct DeviceState {
  std::string name;
  std::string kind;  ///< camera, projector, screen, keys
  bool works = true;
  std::string why = {};    ///< it does not work
  std::size_t images = 0;  ///< taken or shown so far
};

/// Which devices work. From several threads, but for add().
class DeviceHealth {
 public:
  /// Adds a device; returns what it is called by from then on.
  std::size_t add(DeviceState device);

  /// It took or showed an image.
  void works(std::size_t device);
  /// It did not; `why` may be empty.
  void fails(std::size_t device, const std::string& why);
  /// Something else that people are to know.
  void note(const std::string& what);

  std::vector<DeviceState> all() const;
  /// What to tell since the last call: devices that went or came back, each change once.
  std::vector<std::string> news();

 private:
  mutable std::mutex mutex_;
  std::vector<DeviceState> devices_;
  std::vector<std::string> news_;
};

}  // namespace limn::apps
