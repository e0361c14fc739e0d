#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// The configuration of a presentation clicker, pedal or keyboard as a Linux input device (evdev).
struct KeysConfig {
  std::string name;
  std::filesystem::path path;  ///< `/dev/input/by-id/…-event-kbd` always means the same device.
};

/// Keys of one input device, independent of the focused window. While it is open, other programs do not
/// receive its keys.
class KeySource {
 public:
  /// Error: no such device, or no permission to read it.
  static Result<KeySource> open(const KeysConfig& config);
  KeySource(KeySource&& other) noexcept;
  KeySource& operator=(KeySource&&) = delete;
  ~KeySource();

  const std::string& name() const { return config_.name; }

  /// The keys pressed since the last call, as GLFW codes; never waits. Error while the device is gone; once a
  /// second it is tried to open it again.
  Result<std::vector<int>> poll_pressed_keys();

 private:
  KeySource(const KeysConfig& config, int file) : config_(config), file_(file) {}
  void close();

  KeysConfig config_;
  int file_ = -1;
  std::string why_gone_;
  std::chrono::steady_clock::time_point tried_at_{};
};

}  // namespace limn::device
