#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace limn::remote {

/// Status codes (RFC 9110).
constexpr int k_http_bad_request = 400, k_http_unauthorized = 401, k_http_forbidden = 403,
              k_http_not_found = 404, k_http_method_not_allowed = 405, k_http_timeout = 408,
              k_http_content_too_large = 413, k_http_unsupported_media_type = 415,
              k_http_too_many_requests = 429, k_http_headers_too_large = 431, k_http_unavailable = 503;

/// The parts of a request that are used. Absent headers are empty.
struct HttpRequest {
  std::string method;
  std::string target;  ///< As it was sent: path and query.
  std::string host, origin, content_type, authorization, cookie, if_none_match;
  bool is_upgrade = false;  ///< It asks for a WebSocket.
  std::string body;
  std::string address;  ///< The client's numeric address.
};

struct HttpResponse {
  int status = 200;
  std::string type;  ///< MIME type; empty: there is no body.
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
};

/// Sends the response to a request. It is called once, on any thread.
using ResponseCallback = std::function<void(HttpResponse)>;

/// The body {"error": "…"} with a status.
HttpResponse error_response(int status, const std::string& why);

/// The headers of every response that restrict what a browser does with it.
const std::vector<std::pair<std::string, std::string>>& security_headers();

/// The path of a target, without query; nullopt: it does not begin with "/".
std::optional<std::string> path_of(std::string_view target);
/// A part of a path with its %XX decoded; nullopt: it is malformed, or has control characters or "/" in it.
std::optional<std::string> decoded(std::string_view part);

/// The value of a cookie in a Cookie header; empty when it is not there.
std::string cookie_in(std::string_view header, std::string_view name);

/// The host of a Host header, without port and brackets.
std::string host_in(std::string_view header);

}  // namespace limn::remote
