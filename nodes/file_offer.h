#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "core/result.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// Makes the files of a session's folder available to the nodes: lists them, and serves them by content.
class FileOffer {
 public:
  virtual ~FileOffer() = default;
  /// Lists and serves the files of a folder from now on, beside those of earlier calls.
  virtual Result<std::vector<SharedFile>> share(const std::filesystem::path& folder) = 0;
};

/// Makes a folder's files those of a setup: rig/, scene/ and session.json.
using FetchFiles =
    std::function<Status(const Setup& setup, const Offer& host, const std::filesystem::path& folder)>;

}  // namespace limn::nodes
