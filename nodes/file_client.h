#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "core/result.h"
#include "nodes/messages.h"
#include "nodes/token_bucket.h"

namespace limn::nodes {

/// Fetches files from a host's FileServer over one connection, which is opened at the first of
/// Offer::servers that answers and has the host's certificate. It takes at most 9 MB a second, so that the
/// frames of a session that runs find room on a network of 100 Mbit/s. No call waits for ever: see the
/// constants in file_client.cpp.
class FileClient {
 public:
  explicit FileClient(const Offer& host);
  ~FileClient();
  FileClient(const FileClient&) = delete;
  FileClient& operator=(const FileClient&) = delete;

  /// Gives a file's bytes to `write`, in order. Their hash is not checked. Errors: that of `write`; no server
  /// can be reached or is the host's; the host refuses; the connection ends twice in a row; nothing comes for
  /// 5 s.
  Status fetch_file(const SharedFile& file, const std::function<Status(std::string_view bytes)>& write);

 private:
  struct Connection;
  Status connect();
  Result<std::string> fetch_piece(const std::string& target);

  Offer host_;
  TokenBucket received_;
  std::unique_ptr<Connection> connection_;
};

}  // namespace limn::nodes
