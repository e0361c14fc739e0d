#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "remote/http/http.h"

namespace limn::remote {

/// Runs a job on the network's thread. It may be called from any thread.
using NetworkPost = std::function<void(std::function<void()>)>;

/// One message to write to a WebSocket.
struct Outgoing {
  std::shared_ptr<const std::string> bytes;
  bool is_text = true;
};

/// The application's side of one WebSocket. All calls come on the network's thread.
class WebSocketPeer {
 public:
  virtual ~WebSocketPeer() = default;

  /// Called once, after the handshake. `wake` asks the connection to fetch next_message(); the peer calls it
  /// whenever there is something new to write. It does nothing when the connection has ended.
  virtual void open(std::function<void()> wake) = 0;
  virtual void receive_text(std::string_view text) = 0;
  virtual void receive_bytes(std::span<const std::uint8_t> bytes) = 0;
  /// Called when the connection has ended, at least once.
  virtual void close() = 0;

  /// The message to write next; nullopt: there is none now, or never again when is_over().
  virtual std::optional<Outgoing> next_message() = 0;
  /// Whether the connection is to be closed.
  virtual bool is_over() const = 0;
  /// The longest message that is accepted now, bytes.
  virtual std::size_t longest_message() const = 0;
};

/// What answers the network's requests. The network knows this interface alone, so that remote/http depends
/// on no other folder of remote/. All calls come on the network's thread.
class HttpHandler {
 public:
  virtual ~HttpHandler() = default;

  /// Calls `respond` exactly once, perhaps later and on another thread.
  virtual void handle_request(const HttpRequest& request, ResponseCallback respond) = 0;
  /// Handles a request for an upgrade to a WebSocket: the peer of the new connection, or a error_response.
  virtual std::variant<std::shared_ptr<WebSocketPeer>, HttpResponse> accept_web_socket(
      const HttpRequest& request) = 0;
  /// Called about forty times a second, for everything that depends on time.
  virtual void update_at(std::chrono::steady_clock::time_point now) = 0;
  /// Ends all WebSockets; their clients are told why.
  virtual void close_clients(const std::string& why) = 0;
  /// Open WebSockets.
  virtual std::size_t client_count() const = 0;
};

}  // namespace limn::remote
