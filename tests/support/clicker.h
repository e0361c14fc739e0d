#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/input.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

namespace limn::test {

/// A simulated input device: a pipe with the events that Linux would write.
class Clicker {
 public:
  explicit Clicker(const std::filesystem::path& path) {
    ::mkfifo(path.c_str(), 0600);
    file_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK);
  }
  ~Clicker() { ::close(file_); }
  void send(int type, int code, int value) const {
    input_event event{};
    event.type = static_cast<std::uint16_t>(type);
    event.code = static_cast<std::uint16_t>(code);
    event.value = value;
    ASSERT_EQ(::write(file_, &event, sizeof event), static_cast<ssize_t>(sizeof event));
  }
  void send_half() const { ASSERT_EQ(::write(file_, "half", 4), 4); }

 private:
  int file_ = -1;
};

}  // namespace limn::test
