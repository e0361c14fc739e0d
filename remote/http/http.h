#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace limn::remote {

/// What is looked at of a request; absent headers are empty.
struct HttpRequest {
  std::string method;
  std::string target;  ///< as it was sent: path and query
  std::string host, origin, content_type, authorization, cookie, if_none_match;
  bool is_upgrade = false;  ///< to a WebSocket
  std::string body;
  std::string address;  ///< of who asks, numeric
};

struct HttpResponse {
  int status = 200;
  std::string type;  ///< MIME; empty: no body
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers = {};
};

/// Takes an answer, once, from any thread.
using ResponseCallback = std::function<void(HttpResponse)>;

/// {"error": "…"} with a status.
HttpResponse error_response(int status, const std::string& why);

/// On every answer: what a browser may do with it, and what it must not.
const std::vector<std::pair<std::string, std::string>>& security_headers();

/// The path of a target, without query; nullopt: it does not begin with "/".
std::optional<std::string> path_of(std::string_view target);
/// A part of a path with its %XX decoded; nullopt: malformed, or with control characters or "/" in it.
std::optional<std::string> decoded(std::string_view part);

/// The value of a cookie in a Cookie header; empty when it is not there.
std::string cookie_in(std::string_view header, std::string_view name);

/// The host of a Host header, without port and brackets.
std::string host_in(std::string_view header);

}  // namespace limn::remote
