#include "device/address.h"

#include <algorithm>

namespace limn::device {
namespace {

// Where HOST and PORT of an address end, which begin at `begin` with the login. A slash in the password does
// not end them: then what stands before it is no HOST:PORT, and an @ follows.
std::size_t machine_end(const std::string& url, std::size_t begin) {
  const std::size_t slash = std::min(url.size(), url.find('/', begin));
  const std::string head = url.substr(begin, slash - begin);
  const std::size_t at = url.rfind('@', url.find('?', begin));
  const std::size_t colon = head.rfind(':');
  const bool is_machine = head.find('@') != std::string::npos || head.ends_with(']') ||
                          head.find_first_not_of("0123456789", colon + 1) == std::string::npos;
  if (is_machine || colon == std::string::npos || at == std::string::npos || at < slash) return slash;
  return std::min(url.size(), url.find('/', at));
}

}  // namespace

Result<Address> parse_address(const std::string& url,
                              const std::string& scheme,
                              const std::string& default_port) {
  const std::string start = scheme + "://";
  const Error wrong =
      error("expected a camera's address as {}HOST[:PORT]/PATH, found {}.", start, without_login(url));
  if (!url.starts_with(start)) return wrong;
  Address address{.host = {}, .port = default_port, .path = "/", .login = {}, .shown = {}};
  std::string rest = url.substr(start.size());
  if (const std::size_t slash = machine_end(rest, 0); slash < rest.size()) {
    address.path = rest.substr(slash);
    rest.resize(slash);
  }
  if (const std::size_t at = rest.rfind('@'); at != std::string::npos) {
    address.login = rest.substr(0, at);
    rest.erase(0, at + 1);
  }
  address.shown = without_login(url);
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

// A login may have any letters: it ends at the last @ of the whole address.
std::string without_login(const std::string& source) {
  const std::size_t scheme = source.find("://");
  if (scheme == std::string::npos) return source;
  const std::size_t begin = scheme + 3, at = source.rfind('@');
  std::string rest = source.substr(at == std::string::npos || at < begin ? begin : at + 1);
  if (const std::size_t query = rest.find('?'); query != std::string::npos)
    rest.replace(query, rest.npos, "?…");
  return source.substr(0, begin) + rest;
}

}  // namespace limn::device
