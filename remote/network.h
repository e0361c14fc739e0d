#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/result.h"
#include "remote/certificate.h"
#include "remote/reception.h"
#include "session/udp_socket.h"

namespace limn::apps {

/// What a connection may take.
struct NetworkLimits {
  std::size_t connections = 64;         ///< at once; the next are answered 503
  std::size_t of_one_address = 32;      ///< but for the loopback; a phone's page takes up to seven
  std::size_t turned_away = 32;         ///< at once, with a word; more are closed without
  std::size_t header_bytes = 8 * 1024;  ///< of a request
  std::size_t body_bytes = 16 * 1024;
  std::chrono::milliseconds read{10000};     ///< for a handshake, for a whole request, for the next one
  std::chrono::milliseconds write{15000};    ///< for an answer or a message
  std::chrono::milliseconds silence{30000};  ///< of a WebSocket, after which it is asked whether it is there
  std::chrono::milliseconds farewell{1000};  ///< for what was sent meanwhile, before a connection is closed
};

/// The network side of the remote: HTTP, WebSocket and TLS from one path, on one thread of its own. Holds no
/// rule but NetworkLimits; what is asked for goes to a Reception, on that thread.
class Network {
 public:
  /// Takes the port. With a certificate TLS alone is spoken. Error: no address of this machine, the port is
  /// taken. Nobody is answered before start().
  static Result<std::unique_ptr<Network>> open(const NetPlace& place,
                                               const std::optional<Certificate>& certificate,
                                               const NetworkLimits& limits = {});
  ~Network();

  int port() const;
  /// `reception` outlives this object.
  void start(Reception* reception);
  /// Runs it on the network's thread, if that still runs. From any thread, also after stop().
  void post(std::function<void()> job);
  /// Says goodbye to everybody and ends the thread, in half a second.
  void stop();

 private:
  struct Impl;
  explicit Network(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::apps
