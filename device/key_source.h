#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// A presentation clicker, pedal or keyboard by its input device of Linux (evdev).
struct KeysConfig {
  std::string name;
  std::filesystem::path path;  ///< `/dev/input/by-id/…-event-kbd` keeps to one device
};

/// Keys of one input device, whatever window has the focus. While it is open nobody else hears them.
class KeySource {
 public:
  /// Error: no such device, or no right to read it.
  static Result<KeySource> open(const KeysConfig& config);
  KeySource(KeySource&& other) noexcept;
  KeySource& operator=(KeySource&&) = delete;
  ~KeySource();

  const std::string& name() const { return config_.name; }

  /// Keys pressed since the last call, GLFW's codes; never waits. Error: the device is gone; it is opened
  /// again when it comes back, tried once a second.
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
