#include "nodes/setup_loader.h"

#include <chrono>

namespace limn::nodes {

namespace fs = std::filesystem;

SetupLoader::~SetupLoader() {
  if (loading_.valid()) loading_.wait();
}

void SetupLoader::load(const Setup& setup, const Machine& host) {
  next_ = Wanted{setup, host};
  begin_next();
}

void SetupLoader::begin_next() {
  if (!next_ || loading_.valid()) return;
  const fs::path folder = folder_ / fmt::format("setup-{}", ++folders_);
  loading_ = std::async(std::launch::async, [fetch = fetch_, wanted = std::move(*next_), folder] {
    return loaded(fetch, wanted, folder);
  });
  next_.reset();
}

std::optional<Result<LoadedSetup>> SetupLoader::take_loaded() {
  if (!loading_.valid() || loading_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return std::nullopt;
  Result<LoadedSetup> out = loading_.get();
  const bool is_newest = !next_;
  begin_next();
  return is_newest ? std::optional(std::move(out)) : std::nullopt;
}

Result<LoadedSetup> SetupLoader::loaded(const FetchFiles& fetch,
                                        const Wanted& wanted,
                                        const fs::path& folder) {
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  LIMN_TRY_STATUS(fetch(wanted.setup, wanted.host.offer, folder));
  LoadedSetup out{.run = wanted.host.sender.run, .revision = wanted.setup.revision};
  LIMN_TRY(out.session, session::load_setup(folder));
  LIMN_TRY(out.devices, device::parse_devices(wanted.setup.devices, "the host's devices", {}));
  fs::remove_all(folder, ignored);  // all was read
  return out;
}

}  // namespace limn::nodes
