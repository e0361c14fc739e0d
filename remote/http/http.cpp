#include "remote/http/http.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"

namespace limn::remote {

HttpResponse error_response(int status, const std::string& why) {
  const nlohmann::json body = {{"error", why}};
  return {status, "application/json", json_text(body)};
}

const std::vector<std::pair<std::string, std::string>>& security_headers() {
  static const std::vector<std::pair<std::string, std::string>> all = {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
       "manifest-src 'self'; worker-src 'self'; "
       "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
      {"X-Content-Type-Options", "nosniff"},
      {"Referrer-Policy", "no-referrer"},
      {"Cross-Origin-Opener-Policy", "same-origin"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Permissions-Policy", "camera=(self), screen-wake-lock=(self), microphone=(), geolocation=()"},
  };
  return all;
}

std::optional<std::string> path_of(std::string_view target) {
  if (target.empty() || target.front() != '/') return std::nullopt;
  return std::string(target.substr(0, target.find_first_of("?#")));
}

std::optional<std::string> decoded(std::string_view part) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string out;
  for (std::size_t i = 0; i < part.size(); ++i) {
    char c = part[i];
    if (c == '%') {
      const int high = i + 2 < part.size() ? digit(part[i + 1]) : -1;
      const int low = i + 2 < part.size() ? digit(part[i + 2]) : -1;
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high << 4 | low);
      i += 2;
    }
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f || c == '/') return std::nullopt;
    out += c;
  }
  return out;
}

std::string cookie_in(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const auto end = header.find(';');
    std::string_view pair = header.substr(0, end);
    while (!pair.empty() && pair.front() == ' ') pair.remove_prefix(1);
    if (pair.size() > name.size() && pair.substr(0, name.size()) == name && pair[name.size()] == '=')
      return std::string(pair.substr(name.size() + 1));
    header.remove_prefix(end == std::string_view::npos ? header.size() : end + 1);
  }
  return "";
}

std::string host_in(std::string_view header) {
  if (!header.empty() && header.front() == '[') {
    const auto end = header.find(']');
    return end == std::string_view::npos ? "" : std::string(header.substr(1, end - 1));
  }
  return std::string(header.substr(0, header.find(':')));
}

}  // namespace limn::remote
