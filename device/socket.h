#pragma once

#include <array>
#include <string>
#include <string_view>

#include "core/frame.h"
#include "core/result.h"

namespace limn::device {

/// A TCP connection whose functions wait at most until a deadline. Error messages do not name the camera.
class Socket {
 public:
  /// Connects to the first of the host's addresses that answers. Error: unknown host, refused, or no answer
  /// by `deadline`.
  static Result<Socket> connect(const std::string& host, const std::string& port, Stamp deadline);
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&& other) noexcept;
  ~Socket();

  /// Sends a short text (a request). Error when the other side has closed the connection.
  Status send(std::string_view text);

  struct Received {
    std::string_view bytes;  ///< Valid until the next call; empty when nothing has arrived.
    Stamp arrived_at;        ///< Arrival of the last byte, from the kernel if it reports that.
  };
  /// The bytes that have arrived, at most 16 KiB; does not wait. Error when the other side has closed.
  Result<Received> receive();
  /// Waits until something can be received; false when nothing came by `deadline`.
  bool wait(Stamp deadline) const;

 private:
  explicit Socket(int fd) : fd_(fd) {}
  int fd_ = -1;
  std::array<char, 16384> buffer_;
};

}  // namespace limn::device
