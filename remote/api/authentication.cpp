#include "remote/api/authentication.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"
#include "device/udp_socket.h"
#include "remote/api/messages.h"
#include "remote/api/responses.h"
#include "remote/http/own_addresses.h"

namespace limn::remote {

std::optional<HttpResponse> Authentication::check_origin(const HttpRequest& request) const {
  const std::string host = host_in(request.host);
  if (host.empty()) return error_response(k_http_bad_request, "expected a Host header, found none.");
  if (setup_.is_loopback && host != "localhost" && !device::is_loopback(host))
    return error_response(k_http_forbidden,
                          "expected localhost or 127.0.0.1 as the host, found another name.");
  if (!request.origin.empty() &&
      request.origin != (setup_.is_encrypted ? "https://" : "http://") + request.host)
    return error_response(k_http_forbidden,
                          "expected a request of Limn's own page, found one of another origin.");
  return std::nullopt;
}

std::optional<AuthSessions::Guest> Authentication::guest_of(const HttpRequest& request) const {
  constexpr std::string_view k_bearer = "Bearer ";
  const std::string token = request.authorization.starts_with(k_bearer)
                                ? request.authorization.substr(k_bearer.size())
                                : cookie_in(request.cookie, setup_.cookie);
  return sessions_.find(token, AuthSessions::Time::clock::now());
}

HttpResponse Authentication::pair_guest(const HttpRequest& request) {
  const auto pairing = parse_pairing(request.body);
  if (!pairing) return error_response(k_http_bad_request, pairing.message());
  auto result = sessions_.pair(pairing->pin, pairing->name, request.address, AuthSessions::Time::clock::now(),
                               guest_of(request));
  if (const auto* wait = std::get_if<AuthSessions::Wait>(&result)) {
    HttpResponse out = error_response(k_http_too_many_requests,
                                      fmt::format("too many wrong PINs. Wait {} s.", wait->left.count()));
    out.headers.emplace_back("Retry-After", std::to_string(wait->left.count()));
    return out;
  }
  const auto* paired = std::get_if<AuthSessions::Paired>(&result);
  if (!paired)
    return error_response(k_http_unauthorized, "this PIN is wrong. It stands in the operator's window.");
  const auto life_s = std::chrono::seconds(k_session_life).count();
  HttpResponse out = json_response(json_text({{"role", name_of(paired->guest.role)},
                                              {"name", paired->guest.name},
                                              {"token", paired->token},
                                              {"expires_s", life_s}}));
  out.headers.emplace_back(
      "Set-Cookie", fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict; Max-Age={}{}", setup_.cookie,
                                paired->token, life_s, setup_.is_encrypted ? "; Secure" : ""));
  return out;
}

HttpResponse Authentication::end_session(const AuthSessions::Guest& guest) {
  sessions_.end_session(guest.number);
  HttpResponse out = json_response("{}");
  out.headers.emplace_back("Set-Cookie", setup_.cookie + "=; Path=/; HttpOnly; SameSite=Strict; Max-Age=0");
  return out;
}

}  // namespace limn::remote
