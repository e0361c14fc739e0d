#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "remote/api/auth_sessions.h"
#include "remote/http/http.h"

namespace limn::remote {

/// Status 200 with JSON, which no cache keeps.
HttpResponse json_response(std::string body);
/// Status 200 with bytes of a MIME type, which no cache keeps.
HttpResponse uncached_response(std::string type, std::string bytes);

/// Status 403: what was asked for, the role that it needs, and the role that the guest has.
HttpResponse role_refusal(const AuthSessions::Guest& guest, const std::string& what, Role role);

}  // namespace limn::remote
