#pragma once

#include <filesystem>

#include "session/scene_watch.h"
#include "session/session_client.h"

namespace limn::session {

/// Loads and shows the scene again when its files have changed.
class SceneFilesClient final : public SessionClient {
 public:
  explicit SceneFilesClient(std::filesystem::path folder) : files_(std::move(folder)) {}

  void apply_edits(const SessionMoment& moment) override {
    moment.session.reload_changed_scene(&files_, moment.at);
  }
  void publish_state(const SessionMoment&) override {}

 private:
  SceneWatch files_;
};

}  // namespace limn::session
