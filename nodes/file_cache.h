#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <string_view>

#include "core/result.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// The most that stays in a cache, bytes, besides what the last setup needs.
constexpr std::uint64_t k_cache_bytes = 2ull << 30;

/// A folder of files that are named by their SHA-256. Several programs may use it at once, and it may be
/// emptied at any time.
class FileCache {
 public:
  explicit FileCache(std::filesystem::path folder, std::uint64_t most_bytes = k_cache_bytes)
      : folder_(std::move(folder)), most_bytes_(most_bytes) {}

  /// Copies a file to `to`, whose folder exists. (A link would let whoever writes to the copy change the
  /// cache.) False: it is not here, or it is damaged; then it has been removed, and `to` too. Error: `to`
  /// cannot be written.
  Result<bool> copy_file(const SharedFile& file, const std::filesystem::path& to) const;

  using WriteBytes = std::function<Status(std::string_view bytes)>;
  /// Adds a file, whose bytes `fill` gives to its argument, in order. Errors: that of `fill`, other bytes
  /// than those of `file`, or the folder cannot be written; then nothing is added.
  Status add_file(const SharedFile& file, const std::function<Status(const WriteBytes&)>& fill) const;

  /// Removes the files that were not used for longest until the rest is small enough; never one of `needed`.
  void remove_oldest(const std::set<std::string>& needed) const;

 private:
  std::filesystem::path folder_;
  std::uint64_t most_bytes_;
};

}  // namespace limn::nodes
