#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "nodes/file_offer.h"

namespace limn::nodes {

/// Serves the session's files to the nodes over TLS, on threads of its own:
///
///     GET /files/SHA256/PIECE    Authorization: Bearer TOKEN
///
/// PIECE counts from 0; a piece has k_piece_bytes (file_listing.h), so that neither side holds a large file
/// in memory and a slow connection has no time limit but progress. 401: not the token. 404: no such file or
/// piece. 410: the file has changed since it was listed. 503: too many requests wait; ask again.
///
/// All nodes together get at most 50 MB a second, so that frames find room on the network.
///
/// No copies are kept: the hash of each piece is known from the listing, and a piece is sent only if the
/// bytes that were just read still have it. So what is sent is what was listed, whatever happens to the file.
class FileServer final : public FileOffer {
 public:
  /// Opens a server at a free port of all addresses, with a certificate and a token for this run. Error: no
  /// port is free.
  static Result<std::unique_ptr<FileServer>> open();
  ~FileServer() override;

  /// As FileOffer; hashes all files on the caller's thread, which may be any. Error: a file cannot be read,
  /// or list_files() refuses the folder.
  Result<std::vector<SharedFile>> share(const std::filesystem::path& folder) override;

  /// What an Offer says about this server. The addresses are those that the machine has now; the loopback
  /// comes last.
  std::vector<std::string> servers() const;
  const std::string& fingerprint() const;
  const std::string& token() const;

 private:
  struct Impl;
  explicit FileServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::nodes
