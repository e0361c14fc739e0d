#pragma once

#include <chrono>
#include <filesystem>
#include <future>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "scene/scene.h"

namespace limn::apps {

/// A scene as its files are now, and what of it cannot be loaded.
struct SceneNews {
  scene::Scene scene;
  std::vector<scene::SkippedVariant> skipped_variants;
};

/// Watches a scene's folder while a session runs: files that are added, saved or taken away load the scene
/// anew, on a thread of its own, once they have been left alone for a moment.
class SceneWatch {
 public:
  explicit SceneWatch(std::filesystem::path folder);

  /// The scene as it is now, when it has changed; an error when what is there cannot be loaded (once for each
  /// change). Looks at the folder ten times a second at most, and never waits.
  std::optional<Result<SceneNews>> news();

 private:
  using Clock = std::chrono::steady_clock;
  using Files = std::map<std::string, std::pair<std::filesystem::file_time_type, std::uintmax_t>>;
  Files listed() const;

  std::filesystem::path folder_;
  Files loaded_, seen_;
  Clock::time_point looked_at_, changed_at_;
  std::future<Result<SceneNews>> loading_;
};

}  // namespace limn::apps
