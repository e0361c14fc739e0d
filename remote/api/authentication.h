#pragma once

#include <optional>
#include <string>

#include "remote/api/auth_sessions.h"
#include "remote/http/http.h"

namespace limn::remote {

/// A request of a paired guest.
struct AuthenticatedRequest {
  AuthSessions::Guest guest;
  std::string path;  ///< Without the query.
  std::string body;
};

/// Finds out who sends a request: checks its host and origin, pairs by PIN, and reads the token from the
/// cookie or the Authorization header. Belongs to the network's thread.
class Authentication {
 public:
  struct Setup {
    bool is_encrypted = false;
    bool is_loopback = true;  ///< Only requests to this machine's own names are answered.
    std::string cookie;  ///< The cookie's name. It differs by port, since browsers keep one set per host.
  };
  explicit Authentication(Setup setup) : setup_(std::move(setup)) {}

  /// A refusal for requests of other pages (Origin) or to a foreign name of this machine (Host); nullopt:
  /// none.
  std::optional<HttpResponse> check_origin(const HttpRequest& request) const;
  /// The paired guest who sends a request; nullopt: no valid token.
  std::optional<AuthSessions::Guest> guest_of(const HttpRequest& request) const;

  /// Answers POST /api/pair. Status 200: the guest is paired and gets a token and a cookie.
  HttpResponse pair_guest(const HttpRequest& request);
  /// Ends a guest's session. The response removes the cookie.
  HttpResponse end_session(const AuthSessions::Guest& guest);

  const AuthSessions& sessions() const { return sessions_; }

 private:
  Setup setup_;
  AuthSessions sessions_;
};

}  // namespace limn::remote
