#include "device/address.h"

#include <algorithm>

namespace limn::device {

Result<Address> parse_address(const std::string& url,
                              const std::string& scheme,
                              const std::string& default_port) {
  const std::string start = scheme + "://";
  const Error wrong = error("expected a camera's address as {}HOST[:PORT]/PATH, found {}.", start, url);
  if (!url.starts_with(start)) return wrong;
  Address address{.host = {}, .port = default_port, .path = "/", .login = {}, .shown = {}};
  std::string rest = url.substr(start.size());
  if (const std::size_t slash = rest.find('/'); slash != std::string::npos) {
    address.path = rest.substr(slash);
    rest.resize(slash);
  }
  if (const std::size_t at = rest.rfind('@'); at != std::string::npos) {
    address.login = rest.substr(0, at);
    rest.erase(0, at + 1);
  }
  address.shown = start + rest + address.path;
  const std::size_t colon = rest.rfind(':');
  if (colon != std::string::npos && rest.find(']', colon) == std::string::npos) {
    address.port = rest.substr(colon + 1);
    rest.resize(colon);
  }
  if (rest.size() > 2 && rest.front() == '[' && rest.back() == ']') rest = rest.substr(1, rest.size() - 2);
  address.host = rest;
  const bool number =
      std::all_of(address.port.begin(), address.port.end(), [](char c) { return c >= '0' && c <= '9'; });
  const bool line_ends = url.find_first_of("\r\n ") != std::string::npos;
  if (address.host.empty() || address.port.empty() || !number || line_ends) return wrong;
  return address;
}

std::string without_login(const std::string& source) {
  const std::size_t scheme = source.find("://");
  if (scheme == std::string::npos) return source;
  const std::size_t begin = scheme + 3, at = source.rfind('@', source.find('/', begin));
  return at == std::string::npos || at < begin ? source : source.substr(0, begin) + source.substr(at + 1);
}

}  // namespace limn::device
