#include "remote/api/responses.h"

#include <nlohmann/json.hpp>

#include "core/result.h"

namespace limn::remote {

HttpResponse json_response(std::string body) {
  return uncached_response("application/json", std::move(body));
}

HttpResponse uncached_response(std::string type, std::string bytes) {
  return {200, std::move(type), std::move(bytes), {{"Cache-Control", "no-store"}}};
}

HttpResponse role_refusal(const AuthSessions::Guest& guest, const std::string& what, Role role) {
  return error_response(k_http_forbidden,
                        fmt::format("{}: expected the role {}, found {}. Pair with the PIN of {}.", what,
                                    name_of(role), name_of(guest.role), name_of(role)));
}

}  // namespace limn::remote
