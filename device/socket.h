#pragma once

#include <array>
#include <string>
#include <string_view>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// A TCP connection that never waits longer than told. Messages are sentences without a place.
class Socket {
 public:
  /// Connects to the first address of the host that answers. Error: unknown host, refused, no answer by
  /// `deadline`.
  static Result<Socket> connect(const std::string& host, const std::string& port, Stamp deadline);
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&& other) noexcept;
  ~Socket();

  /// Sends a short text (a request). Error when the other side has gone.
  Status send(std::string_view text);

  struct Received {
    std::string_view bytes;  ///< valid until the next call; empty when nothing waits
    Stamp arrived_at;        ///< of the last byte, by the kernel's clock where it tells
  };
  /// What waits, at most 16 KiB, without waiting for more. Error when the other side has gone.
  Result<Received> receive();
  /// Waits until something can be received; false when nothing came by `deadline`.
  bool wait(Stamp deadline) const;

 private:
  explicit Socket(int fd) : fd_(fd) {}
  int fd_ = -1;
  std::array<char, 16384> buffer_;
};

}  // namespace limn::device
