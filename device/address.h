#pragma once

#include <string>

#include "core/result.h"

namespace limn::device {

/// A camera's address in the network.
struct Address {
  std::string host, port, path;
  std::string login;  ///< NAME:PASSWORD, empty without
  std::string shown;  ///< for messages: without the login
};

/// Takes `SCHEME://[NAME:PASSWORD@]HOST[:PORT][/PATH]` apart; an IPv6 host stands in brackets. Error:
/// anything else, with the form.
Result<Address> parse_address(const std::string& url,
                              const std::string& scheme,
                              const std::string& default_port);

}  // namespace limn::device
