#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

/// "ADDRESS:PORT"; an IPv6 address stands in brackets.
struct NetPlace {
  std::string host;
  std::string port;
};
/// A port alone has `default_host`. Error: no port from 1 to 65535 (with `or_any`, 0: any free one), an
/// empty host.
Result<NetPlace> net_place(const std::string& text, const std::string& default_host, bool or_any = false);

/// A UDP socket that never waits.
class UdpSocket {
 public:
  /// Hears what is sent to a numeric address of this machine. Error: no such address here, the port is taken.
  static Result<UdpSocket> hearing(const NetPlace& place);
  /// Sends to a host. Error: a host without an address.
  static Result<UdpSocket> sending(const NetPlace& place);
  UdpSocket(UdpSocket&& other) noexcept;
  UdpSocket& operator=(UdpSocket&& other) noexcept;
  ~UdpSocket();

  /// The next datagram into `bytes`, which is filled as far as it goes; its true length. nullopt: none waits.
  std::optional<std::size_t> next(std::span<std::uint8_t> bytes);
  /// Lost when nobody hears it or the network is busy.
  void send(std::span<const std::uint8_t> bytes);
  /// The port that it hears on.
  int port() const;

 private:
  explicit UdpSocket(int handle) : handle_(handle) {}
  int handle_ = -1;
};

}  // namespace limn::apps
