#pragma once

#include <chrono>
#include <filesystem>
#include <future>
#include <map>
#include <optional>
#include <set>
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
/// changed for a moment since, it loads the scene again on a thread of its own. A CAD file that has to be
/// read is left out at first; it is read on another thread, and the scene is then loaded once more.
class SceneWatch {
 public:
  explicit SceneWatch(std::filesystem::path folder);
  ~SceneWatch() { stop_.request_stop(); }  ///< Ends the reading of CAD files.

  /// The scene after its files have changed, or an error if it cannot be loaded; once for each change. Checks
  /// the folder ten times a second at most, and never waits.
  std::optional<Result<LoadedScene>> take_changed_scene();

 private:
  using Clock = std::chrono::steady_clock;
  using Files = std::map<std::string, std::pair<std::filesystem::file_time_type, std::uintmax_t>>;
  /// A scene, and the CAD files that are left out of it because they have to be read.
  struct Loading {
    Result<LoadedScene> scene;
    std::vector<std::filesystem::path> unread_cad;
  };
  Files listed() const;
  Loading load(bool reads_cad) const;
  void read_cad(const std::vector<std::filesystem::path>& files);

  std::filesystem::path folder_;
  Files loaded_, seen_;
  Clock::time_point looked_at_, changed_at_;
  std::stop_source stop_;
  std::set<std::filesystem::path> tried_cad_;  // since files changed last
  bool reads_cad_ = false;                     // the next time that the scene is loaded
  std::future<Loading> loading_;
  std::future<void> reading_;
};

}  // namespace limn::session
