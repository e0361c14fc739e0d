#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "nodes/messages.h"

namespace limn::test {

/// A host's file server that answers every request in the same, perhaps wrong, way. It listens on the
/// loopback.
class BrokenFileServer {
 public:
  /// Sends bytes to the node.
  using Send = std::function<void(std::string_view bytes)>;
  /// `answer` is called on the server's thread for each request; when it returns, the connection ends without
  /// a word.
  explicit BrokenFileServer(std::function<void(const Send& send)> answer);
  ~BrokenFileServer();
  BrokenFileServer(const BrokenFileServer&) = delete;
  BrokenFileServer& operator=(const BrokenFileServer&) = delete;

  /// The offer of a host that has this server.
  nodes::Offer offer() const;
  int connections() const;  ///< whose TLS handshake succeeded
  int requests() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::test
