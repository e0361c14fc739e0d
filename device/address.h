#pragma once

#include <string>

#include "core/result.h"

namespace limn::device {

/// A camera's network address.
struct Address {
  std::string host, port, path;
  std::string login;  ///< NAME:PASSWORD; empty: none.
  std::string shown;  ///< The address without login and query, for messages (without_login).
};

/// Parses `SCHEME://[NAME:PASSWORD@]HOST[:PORT][/PATH]`; an IPv6 host is in brackets. The error for anything
/// else names this form.
Result<Address> parse_address(const std::string& url,
                              const std::string& scheme,
                              const std::string& default_port);

/// A camera's source without NAME:PASSWORD and without its query, in which some cameras take a password, for
/// messages.
std::string without_login(const std::string& source);

}  // namespace limn::device
