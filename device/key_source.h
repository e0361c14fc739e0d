#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// A presentation clicker, pedal or keyboard by its input device of Linux (evdev).
struct KeysWanted {
  std::string name;
  std::filesystem::path path;  ///< `/dev/input/by-id/…-event-kbd` keeps to one device
};

/// Keys of one input device, whatever window has the focus. While it is open nobody else hears them.
class KeySource {
 public:
  /// Error: no such device, or no right to read it.
  static Result<KeySource> open(const KeysWanted& wanted);
  KeySource(KeySource&& other) noexcept;
  KeySource& operator=(KeySource&&) = delete;
  ~KeySource();

  const std::string& name() const { return wanted_.name; }

  /// Keys pressed since the last call, GLFW's codes; never waits. Error: the device is gone; it is opened
  /// again when it comes back, tried once a second.
  Result<std::vector<int>> pressed();

 private:
  KeySource(const KeysWanted& wanted, int file) : wanted_(wanted), file_(file) {}
  void close();

  KeysWanted wanted_;
  int file_ = -1;
  std::string why_gone_;
  std::chrono::steady_clock::time_point tried_at_{};
};

}  // namespace limn::device
