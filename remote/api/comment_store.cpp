#include "remote/api/comment_store.h"

#include <algorithm>

#include "core/file.h"
#include "core/log.h"
#include "remote/api/responses.h"
#include "scene/kept_files.h"

namespace limn::remote {
namespace {

constexpr const char* k_comments_file = "comments.json";

}  // namespace

void CommentStore::load_once(const std::filesystem::path& scene_folder) {
  if (comments_) return;
  comments_ = scene::load_comments(scene::kept_file(scene_folder, k_comments_file));
  if (!*comments_) log_warning("live: {} Nobody can comment.", comments_->message());
}

std::optional<HttpResponse> CommentStore::add(const AuthSessions::Guest& guest,
                                              const CommentRequest& request,
                                              const SessionUpdate* update,
                                              Saved saved) {
  if (guest.role < Role::work) return role_refusal(guest, "comment", Role::work);
  if (!comments_ || !update) return error_response(k_http_unavailable, "the session has not begun yet.");
  if (!*comments_) return error_response(k_http_unavailable, comments_->message());
  if (!request.slot.empty() && !update->scene->find_slot(request.slot))
    return error_response(k_http_bad_request, "slot: expected one of the state, found another.");
  const std::vector<std::string>& looks = update->state.looks;
  if (!request.look.empty() && std::find(looks.begin(), looks.end(), request.look) == looks.end())
    return error_response(k_http_bad_request, "look: expected one of the state, found another.");
  auto comment = scene::make_comment(guest.name, request.look, request.slot, request.text);
  if (!comment) return error_response(k_http_bad_request, comment.message());
  std::vector<scene::Comment>& all = **comments_;
  if (all.size() >= scene::k_most_comments)
    return error_response(k_http_unavailable,
                          fmt::format("the project keeps {} comments at most.", all.size()));
  all.push_back(std::move(*comment));
  const bool is_queued =
      worker_->add_job([post = post_, all, saved = std::move(saved),
                        path = scene::kept_folder(update->scene->folder) / k_comments_file] {
        Status status = make_folder(path.parent_path());
        if (status) status = scene::save_comments(path, all);
        post([saved, why = status ? "" : status.message()] { saved(why); });
      });
  if (!is_queued) {
    all.pop_back();
    return error_response(k_http_unavailable, "too much is being saved. Try again in a moment.");
  }
  return std::nullopt;
}

std::span<const scene::Comment> CommentStore::newest() const {
  if (!comments_ || !*comments_) return {};
  const std::span<const scene::Comment> all = **comments_;
  return all.last(std::min(all.size(), k_max_published_comments));
}

}  // namespace limn::remote
