#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/result.h"
#include "device/udp_socket.h"
#include "remote/http/certificate.h"
#include "remote/http/http_handler.h"

namespace limn::remote {

/// The limits of connections.
struct NetworkLimits {
  /// Open at once. One more closes a connection without a request, of an address with more connections; if
  /// there is none, it is answered 503.
  std::size_t connections = 64;
  std::size_t per_address = 32;  ///< Without limit for the loopback. One phone's page uses up to seven.
  std::size_t rejected = 32;  ///< Connections that are being answered 503; more are closed without an answer.
  std::size_t header_bytes = 8 * 1024;  ///< Longest headers of one request.
  std::size_t body_bytes = 16 * 1024;
  std::chrono::milliseconds read{10000};   ///< Time for a handshake, for a whole request, until the next one.
  std::chrono::milliseconds write{15000};  ///< Time for an answer or a message.
  std::chrono::milliseconds silence{30000};  ///< A WebSocket that is silent for so long is pinged.
  std::chrono::milliseconds drain{1000};     ///< How long incoming bytes are dropped before a close.
};

/// The network side of the remote: HTTP, WebSocket and TLS on one port, on one thread of its own. It has no
/// rules but NetworkLimits; an HttpHandler answers requests, on that thread.
class Network {
 public:
  /// Binds the port. With a certificate only TLS is accepted. Errors: the address is not this machine's, or
  /// the port is in use. No request is answered before start().
  static Result<std::unique_ptr<Network>> open(const device::NetPlace& place,
                                               const std::optional<Certificate>& certificate,
                                               const NetworkLimits& limits = {});
  ~Network();

  int port() const;
  /// Starts the thread. `handler` must outlive this object.
  void start(HttpHandler* handler);
  /// Runs a job on the network's thread, if that still runs. May be called from any thread, also after
  /// stop().
  void post(std::function<void()> job);
  /// Closes all connections and ends the thread, within half a second.
  void stop();

 private:
  struct Impl;
  explicit Network(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::remote
