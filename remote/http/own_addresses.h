#pragma once

#include <string>
#include <vector>

namespace limn::remote {

/// Whether an address stands for all addresses of the machine: 0.0.0.0 or ::.
bool is_unspecified(const std::string& address);

/// This machine's numeric addresses, IPv4 first, without loopback and link-local addresses.
std::vector<std::string> own_addresses();
/// The same, then the link-local ones. Another machine reaches one of IPv6 only through an interface of its
/// own, which it must know.
std::vector<std::string> own_addresses_with_link_local();
/// This machine's host name; empty when it has none.
std::string own_host_name();

}  // namespace limn::remote
