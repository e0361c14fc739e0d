#include "session/scene_watch.h"

#include <utility>

#include "scene/kept_files.h"
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
    const bool is_own = (at.depth() == 0 && (name == "pairings.json" || name == "comments.json" ||
                                             name == scene::k_drawn_lines_file)) ||
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

SceneWatch::Loading SceneWatch::load(bool reads_cad) const {
  std::vector<fs::path> unread;
  LoadedScene in;
  auto scene = scene::load_scene(folder_, &in.skipped_variants, scene::EmptySlots::kept,
                                 {stop_.get_token(), reads_cad ? nullptr : &unread});
  if (!scene) return {scene.error(), std::move(unread)};
  in.scene = std::move(*scene);
  return {std::move(in), std::move(unread)};
}

// Reads CAD files, so that what is made of them is kept. What cannot be kept is read once more when the scene
// is loaded.
void SceneWatch::read_cad(const std::vector<fs::path>& files) {
  std::vector<fs::path> fresh;
  for (const fs::path& file : files)
    if (tried_cad_.insert(file).second) fresh.push_back(file);
  reads_cad_ = fresh.empty();
  reading_ = std::async(std::launch::async, [fresh, stop = stop_.get_token()] {
    for (const fs::path& file : fresh) static_cast<void>(scene::cad_as_glb(file, {}, {stop}));
  });
}

std::optional<Result<LoadedScene>> SceneWatch::take_changed_scene() {
  const auto is_ready = [](const auto& future) {
    return future.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  if (loading_.valid()) {
    if (!is_ready(loading_)) return std::nullopt;
    Loading loaded = loading_.get();
    if (!loaded.unread_cad.empty() && !reading_.valid()) read_cad(loaded.unread_cad);
    return std::move(loaded.scene);
  }
  const auto now = Clock::now();
  if (now - looked_at_ < k_look_every) return std::nullopt;
  looked_at_ = now;
  Files files = listed();
  if (files != seen_) {
    seen_ = std::move(files);
    changed_at_ = now;
    tried_cad_.clear();
  }
  const bool has_read = reading_.valid() && is_ready(reading_);
  if ((seen_ == loaded_ && !has_read) || now - changed_at_ < k_left_alone) return std::nullopt;
  if (has_read) reading_.get();
  loaded_ = seen_;
  loading_ = std::async(std::launch::async,
                        [this, reads = std::exchange(reads_cad_, false)] { return load(reads); });
  return std::nullopt;
}

}  // namespace limn::session
