#include "nodes/setup_loader.h"

#include <algorithm>
#include <chrono>

namespace limn::nodes {

namespace fs = std::filesystem;

namespace {

bool is_deviation(const SharedFile& file) { return file.path == session::k_deviation_file; }

}  // namespace

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

DeviationLoader::~DeviationLoader() {
  if (loading_.valid()) loading_.wait();
}

void DeviationLoader::load(const Setup& setup, const Machine& host) {
  setup_ = setup;
  host_run_ = host.sender.run;
  Setup file = setup;
  std::erase_if(file.files, [](const SharedFile& one) { return !is_deviation(one); });
  loading_ = std::async(
      std::launch::async,
      [fetch = fetch_, folder = folder_, file = std::move(file), offer = host.offer]() -> Result<Layer> {
        LIMN_TRY_STATUS(fetch(file, offer, folder));
        auto layer = session::load_deviation(folder);
        std::error_code ignored;
        fs::remove_all(folder, ignored);
        return layer;
      });
}

std::optional<Result<DeviationLoader::Layer>> DeviationLoader::take_loaded() {
  if (!loading_.valid() || loading_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return std::nullopt;
  return loading_.get();
}

bool differ_in_deviation_only(const Setup& a, const Setup& b) {
  const auto others = [](std::vector<SharedFile> files) {
    std::erase_if(files, is_deviation);
    return files;
  };
  return a.devices == b.devices && others(a.files) == others(b.files) &&
         std::ranges::any_of(b.files, is_deviation);
}

}  // namespace limn::nodes
