#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/worker_thread.h"
#include "remote/api/auth_sessions.h"
#include "remote/api/messages.h"
#include "remote/api/session_update.h"
#include "remote/http/http.h"
#include "remote/http/http_handler.h"
#include "scene/comments.h"

namespace limn::remote {

/// How many of a project's comments the state holds: the newest.
constexpr std::size_t k_max_published_comments = 100;

/// The comments of a project, in comments.json where scene/kept_files.h says. Belongs to the network's
/// thread; files are written on the worker thread.
class CommentStore {
 public:
  /// Called on the network's thread when the comments are saved; `why` is empty, or says why they are not.
  using Saved = std::function<void(const std::string& why)>;

  CommentStore(WorkerThread* worker, NetworkPost post) : worker_(worker), post_(std::move(post)) {}

  /// Reads the comments, the first time alone. A file that cannot be read is a warning, and then no comment
  /// can be added.
  void load_once(const std::filesystem::path& scene_folder);

  /// Adds a comment and saves all. `update` is null before the session has begun. A refusal: the guest's role
  /// is too low, there is no session yet, the slot or the look does not exist, the text is refused, or there
  /// are too many comments; then `saved` is not called.
  std::optional<HttpResponse> add(const AuthSessions::Guest& guest,
                                  const CommentRequest& request,
                                  const SessionUpdate* update,
                                  Saved saved);

  /// The newest k_max_published_comments, the newest last. Valid until the next add().
  std::span<const scene::Comment> newest() const;

 private:
  WorkerThread* worker_;
  NetworkPost post_;
  std::optional<Result<std::vector<scene::Comment>>> comments_;  // nullopt: not loaded yet
};

}  // namespace limn::remote
