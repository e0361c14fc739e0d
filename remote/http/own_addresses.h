#pragma once

#include <string>
#include <vector>

namespace limn::remote {

/// Whether an address stands for all addresses of the machine: 0.0.0.0 or ::.
bool is_unspecified(const std::string& address);

/// This machine's numeric addresses, IPv4 first, without loopback and link-local addresses.
std::vector<std::string> own_addresses();
/// This machine's host name; empty when it has none.
std::string own_host_name();

}  // namespace limn::remote
