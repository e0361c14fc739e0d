#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// "ADDRESS:PORT"; an IPv6 address stands in brackets.
struct NetPlace {
  std::string host;
  std::string port;
};
/// Parses HOST:PORT; a port alone gets `default_host`. Error: not a port from 1 to 65535 (with `or_any` 0 is
/// allowed too: any free port), or an empty host.
Result<NetPlace> net_place(const std::string& text, const std::string& default_host, bool or_any = false);

/// The usual spelling of a numeric IPv4 or IPv6 address, without brackets; nullopt: it is something else.
std::optional<std::string> numeric_address(const std::string& text);
/// Whether it is a numeric address of the loopback, which no other machine can reach: 127.0.0.0/8 or ::1.
bool is_loopback(const std::string& address);

struct Datagram {
  std::size_t length = 0;  ///< The whole datagram's, also when it was cut off.
  std::string from;        ///< The sender's numeric address, IPv4 where it has one.
  double age_s = 0;        ///< How long it has waited in the system's buffer.
};

/// A UDP socket that never waits.
class UdpSocket {
 public:
  /// Opens a socket that receives at a numeric address of this machine, or as a member of an IPv4 multicast
  /// group (224.0.0.0 to 239.255.255.255), whose port others may use too. Error: this machine has no such
  /// address, the port is in use, or the group cannot be joined.
  static Result<UdpSocket> receiving(const NetPlace& place);
  /// Opens a socket that sends to a host. Error: the host has no address.
  static Result<UdpSocket> sending(const NetPlace& place);
  UdpSocket(UdpSocket&& other) noexcept;
  UdpSocket& operator=(UdpSocket&& other) noexcept;
  ~UdpSocket();

  /// Reads the next datagram into `bytes`, cut off where it is longer. nullopt: none waits.
  std::optional<Datagram> next(std::span<std::uint8_t> bytes);
  /// Sends a datagram. It is lost when nobody receives it or the network is busy.
  void send(std::span<const std::uint8_t> bytes);
  /// The port on which it receives.
  int port() const;

 private:
  explicit UdpSocket(int handle) : handle_(handle) {}
  int handle_ = -1;
};

}  // namespace limn::device
