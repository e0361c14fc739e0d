#include "remote/api/pending_edits.h"

#include <vector>

#include "remote/api/responses.h"
#include "remote/api/roles.h"

namespace limn::remote {

std::optional<HttpResponse> PendingEdits::add(const AuthSessions::Guest& guest,
                                              const scene::Edit& edit,
                                              EditCallback callback) {
  const Role role = role_for(edit.action);
  if (guest.role < role) return role_refusal(guest, edit.action, role);
  if (pending_.size() >= k_max_pending_edits)
    return error_response(k_http_too_many_requests,
                          "too many edits wait for the session. Try again in a moment.");
  const auto now = Clock::now();
  pending_.emplace(++last_number_, Pending{std::move(callback), now});
  submit_({last_number_, edit, guest.name, now});
  return std::nullopt;
}

void PendingEdits::finish(std::span<const EditResult> results, std::uint64_t state_number) {
  for (const EditResult& result : results) {
    const auto found = pending_.extract(result.number);
    if (!found.empty()) found.mapped().callback(result.why, state_number);
  }
}

void PendingEdits::expire(Clock::time_point now, std::uint64_t state_number) {
  std::vector<EditCallback> expired;
  std::erase_if(pending_, [&](auto& entry) {
    if (now - entry.second.requested_at < k_edit_timeout) return false;
    expired.push_back(std::move(entry.second.callback));
    return true;
  });
  for (const EditCallback& callback : expired) callback(std::string(k_edit_timed_out), state_number);
}

}  // namespace limn::remote
