#include "nodes/shared_files.h"

#include <chrono>
#include <set>
#include <string>
#include <system_error>

#include "core/file.h"
#include "core/log.h"
#include "core/stopwatch.h"
#include "core/user_folder.h"
#include "nodes/file_cache.h"
#include "nodes/file_client.h"
#include "nodes/file_listing.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;

struct Fetched {
  int files = 0;
  std::uint64_t bytes = 0;
};

// Makes one file in `folder` from the cache, which it fetches it into before if necessary.
Status lay_out_file(const SharedFile& file,
                    const FileCache& cache,
                    const fs::path& folder,
                    FileClient* client,
                    Fetched* fetched) {
  const fs::path to = folder / file.path;
  LIMN_TRY_STATUS(make_folder(to.parent_path()));
  LIMN_TRY(const bool was_there, cache.copy_file(file, to));
  if (was_there) return {};
  LIMN_TRY_STATUS(cache.add_file(
      file, [&](const FileCache::WriteBytes& write) { return client->fetch_file(file, write); }));
  ++fetched->files;
  fetched->bytes += file.bytes;
  LIMN_TRY(const bool is_there, cache.copy_file(file, to));
  if (is_there) return {};
  return error("{}: expected to find the file again that was just written to the cache. Check the disk.",
               to.string());
}

Status lay_out_files(const Setup& setup, const Offer& host, const FileCache& cache, const fs::path& folder) {
  const Stamp begun_at = std::chrono::steady_clock::now();
  FileClient client(host);
  Fetched fetched;
  LIMN_TRY_STATUS(make_folder(folder));
  for (const SharedFile& file : setup.files)
    LIMN_TRY_STATUS(lay_out_file(file, cache, folder, &client, &fetched));
  if (fetched.files > 0)
    log_info("node: fetched {} of {} files from the host, {:.1f} MB in {:.1f} s", fetched.files,
             setup.files.size(), 1e-6 * static_cast<double>(fetched.bytes),
             1e-3 * milliseconds_since(begun_at));
  return {};
}

Status fetch_setup(const Setup& setup, const Offer& host, fs::path cache_folder, const fs::path& folder) {
  LIMN_TRY_STATUS(check_listing(setup.files));
  if (cache_folder.empty()) {
    LIMN_TRY(const fs::path all, user_cache_folder());
    cache_folder = all / "files";
  }
  const FileCache cache(cache_folder);
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  const Status status = lay_out_files(setup, host, cache, folder);
  if (!status) fs::remove_all(folder, ignored);
  std::set<std::string> needed;
  for (const SharedFile& file : setup.files) needed.insert(file.sha256);
  cache.remove_oldest(needed);
  return status;
}

}  // namespace

FetchFiles fetch_from_host(const fs::path& cache_folder) {
  return [cache_folder](const Setup& setup, const Offer& host, const fs::path& folder) {
    return fetch_setup(setup, host, cache_folder, folder);
  };
}

}  // namespace limn::nodes
