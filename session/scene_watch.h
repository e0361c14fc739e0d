#pragma once

#include <chrono>
#include <filesystem>
#include <future>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "scene/scene.h"

namespace limn::session {

/// A scene as its files are now, with slots that have no variants, and what is left out.
struct LoadedScene {
  scene::Scene scene;
  std::vector<scene::SkippedVariant> skipped_variants;
};

/// Watches a scene's folder while a session runs. When files were added, saved or removed, and have not
/// changed for a moment since, it loads the scene again on a thread of its own.
class SceneWatch {
 public:
  explicit SceneWatch(std::filesystem::path folder);
  ~SceneWatch() { stop_.request_stop(); }  ///< A CAD file that is being read is left.

  /// The scene after its files have changed, or an error if it cannot be loaded; once for each change. Checks
  /// the folder ten times a second at most, and never waits.
  std::optional<Result<LoadedScene>> take_changed_scene();

 private:
  using Clock = std::chrono::steady_clock;
  using Files = std::map<std::string, std::pair<std::filesystem::file_time_type, std::uintmax_t>>;
  Files listed() const;

  std::filesystem::path folder_;
  Files loaded_, seen_;
  Clock::time_point looked_at_, changed_at_;
  std::stop_source stop_;
  std::future<Result<LoadedScene>> loading_;
};

}  // namespace limn::session
