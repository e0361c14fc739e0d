#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "remote/api/auth_sessions.h"
#include "remote/http/http.h"
#include "scene/actions.h"

namespace limn::remote {

/// Edits that may wait for the session at once; further ones are refused.
constexpr std::size_t k_max_pending_edits = 256;
/// Time that the session has for an edit. After it the edit is answered as failed, and the session drops it.
constexpr std::chrono::seconds k_edit_timeout{10};
/// The reason that such an edit is answered with.
constexpr std::string_view k_edit_timed_out = "the session did not answer in time.";

/// An edit that a guest asks the session for.
struct EditRequest {
  std::uint64_t number = 0;
  scene::Edit edit;
  std::string who;
  std::chrono::steady_clock::time_point requested_at;
};

/// What became of an edit.
struct EditResult {
  std::uint64_t number = 0;  ///< As in the request.
  std::string why;           ///< Why it was not done; empty: it was done.
};

/// Called once, when an edit or a comment is done or has failed (`why`). `state_number` is the number of the
/// first published state that shows it.
using EditCallback = std::function<void(const std::string& why, std::uint64_t state_number)>;

/// Edits that wait for the session: hands them over, and calls back when the session has done them or was too
/// slow. Belongs to the network's thread.
class PendingEdits {
 public:
  using Clock = std::chrono::steady_clock;

  /// `submit` hands an edit to the session; it must not wait.
  explicit PendingEdits(std::function<void(EditRequest)> submit) : submit_(std::move(submit)) {}

  /// Submits an edit. A refusal: the guest's role is too low, or too many edits wait; then `callback` is not
  /// called.
  std::optional<HttpResponse> add(const AuthSessions::Guest& guest,
                                  const scene::Edit& edit,
                                  EditCallback callback);
  /// Calls back for edits that the session has finished.
  void finish(std::span<const EditResult> results, std::uint64_t state_number);
  /// Calls back for edits that have waited for k_edit_timeout.
  void expire(Clock::time_point now, std::uint64_t state_number);

 private:
  struct Pending {
    EditCallback callback;
    Clock::time_point requested_at;
  };

  std::function<void(EditRequest)> submit_;
  std::map<std::uint64_t, Pending> pending_;  // by the request's number
  std::uint64_t last_number_ = 0;
};

}  // namespace limn::remote
