#pragma once

#include <filesystem>

#include "session/scene_watch.h"
#include "session/session_client.h"

namespace limn::apps {

/// Loads and shows the scene again when its files have changed.
class SceneFilesClient final : public SessionClient {
 public:
  explicit SceneFilesClient(std::filesystem::path folder) : files_(std::move(folder)) {}

  void hear(const SessionMoment& moment) override { moment.session.show_news(&files_, moment.at); }
  void tell(const SessionMoment&) override {}

 private:
  SceneWatch files_;
};

}  // namespace limn::apps
