#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <string>

#include "core/frame.h"

namespace limn::test {

/// The socket of a service manager, at which programs send their state (sd_notify(3)).
class NotifySocket {
 public:
  NotifySocket() {
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    address_ = "@limn-test-" + std::to_string(getpid());  // abstract: a folder's path may be too long
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    std::memcpy(to.sun_path + 1, address_.data() + 1, address_.size() - 1);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&to), size), 0);
  }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;
  ~NotifySocket() { close(socket_); }

  /// The value of NOTIFY_SOCKET.
  const std::string& address() const { return address_; }

  /// The next message; empty when none comes within that time.
  std::string next(double limit_s) const {
    pollfd ready{socket_, POLLIN, 0};
    if (poll(&ready, 1, static_cast<int>(1e3 * limit_s)) <= 0) return {};
    std::array<char, 512> text{};
    const ssize_t size = recv(socket_, text.data(), text.size(), 0);
    return {text.data(), size > 0 ? static_cast<std::size_t>(size) : 0};
  }
  /// Whether a message that begins so comes within that time. Others before it are dropped.
  bool receives(const std::string& message, double limit_s) const {
    const Stamp until = shifted(now(), limit_s);
    while (now() < until)
      if (next(seconds_between(now(), until)).starts_with(message)) return true;
    return false;
  }
  /// Drops the messages that have come so far.
  void forget() const {
    while (!next(0).empty()) {
    }
  }

 private:
  int socket_ = -1;
  std::string address_;
};

}  // namespace limn::test
