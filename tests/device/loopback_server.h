#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <string_view>
#include <thread>

namespace limn::test {

/// One client of a LoopbackServer.
class LoopbackClient {
 public:
  explicit LoopbackClient(int fd) : fd_(fd) {}
  LoopbackClient(const LoopbackClient&) = delete;
  LoopbackClient& operator=(const LoopbackClient&) = delete;
  ~LoopbackClient();

  /// Sends everything; false once the client has closed the connection.
  bool send(std::string_view bytes);
  /// The bytes that the client sends, up to and including `end`; fewer when it closes the connection.
  std::string receive_until(const std::string& end);

 private:
  int fd_;
};

/// A TCP server on 127.0.0.1 that serves one client after another on its own thread.
class LoopbackServer {
 public:
  /// Port 0 means a free port. `serve` talks to a client; when it returns, the connection ends.
  explicit LoopbackServer(std::function<void(LoopbackClient&)> serve, int port = 0);
  /// Waits for `serve`, which must return when its sends fail.
  ~LoopbackServer();

  int port() const { return port_; }
  int clients() const { return clients_; }

 private:
  void run(const std::function<void(LoopbackClient&)>& serve);
  int listener_ = -1;
  int port_ = 0;
  std::atomic<int> clients_ = 0;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace limn::test
