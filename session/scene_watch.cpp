#include "session/scene_watch.h"

#include "scene/meshes/cad_file.h"
#include "scene/scene_loading.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

constexpr auto k_look_every = std::chrono::milliseconds(100);
// Files must be unchanged for this long: a file that is being written still grows.
constexpr auto k_left_alone = std::chrono::milliseconds(150);

}  // namespace

SceneWatch::SceneWatch(fs::path folder) : folder_(std::move(folder)), loaded_(listed()), seen_(loaded_) {}

// Lists all files except what the session, the remote and the reader of CAD files write.
SceneWatch::Files SceneWatch::listed() const {
  Files files;
  std::error_code none;
  fs::recursive_directory_iterator at(folder_, none), end;
  while (!none && at != end) {
    if (at.depth() == 0 && at->path().filename() == "looks") at.disable_recursion_pending();
    std::error_code gone;
    const fs::path name = at->path().filename();
    const bool is_own = (at.depth() == 0 && (name == "pairings.json" || name == "comments.json")) ||
                        scene::is_cad_cache_name(name);
    if (!is_own && at->is_regular_file(gone)) {
      const auto time = at->last_write_time(gone);
      const auto size = at->file_size(gone);
      if (!gone) files[at->path().string()] = {time, size};
    }
    at.increment(none);
  }
  return files;
}

std::optional<Result<LoadedScene>> SceneWatch::take_changed_scene() {
  if (loading_.valid()) {
    if (loading_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return std::nullopt;
    return loading_.get();
  }
  const auto now = Clock::now();
  if (now - looked_at_ < k_look_every) return std::nullopt;
  looked_at_ = now;
  Files files = listed();
  if (files != seen_) {
    seen_ = std::move(files);
    changed_at_ = now;
  }
  if (seen_ == loaded_ || now - changed_at_ < k_left_alone) return std::nullopt;
  loaded_ = seen_;
  loading_ =
      std::async(std::launch::async, [folder = folder_, s = stop_.get_token()]() -> Result<LoadedScene> {
        LoadedScene in;
        LIMN_TRY(in.scene, scene::load_scene(folder, &in.skipped_variants, scene::EmptySlots::kept, s));
        return in;
      });
  return std::nullopt;
}

}  // namespace limn::session
