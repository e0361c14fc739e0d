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

  /// Sends everything; false once the client has gone.
  bool send(std::string_view bytes);
  /// What the client sends, up to and with `end`; shorter when it goes.
  std::string receive_until(const std::string& end);

 private:
  int fd_;
};

/// A TCP server on 127.0.0.1 that serves one client after another on a thread of its own.
class LoopbackServer {
 public:
  /// `port` 0: a free one. `serve` speaks to a client until it returns; the connection then ends.
  explicit LoopbackServer(std::function<void(LoopbackClient&)> serve, int port = 0);
  /// Waits for `serve`, which must return once its sends fail.
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
