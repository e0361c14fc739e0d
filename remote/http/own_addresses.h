#pragma once

#include <string>
#include <vector>

namespace limn::remote {

/// Whether a numeric address is the loopback's, which no other machine can reach: 127.0.0.0/8 or ::1.
bool is_loopback(const std::string& address);
/// Whether an address stands for all addresses of the machine: 0.0.0.0 or ::.
bool is_unspecified(const std::string& address);

/// This machine's numeric addresses, IPv4 first, without loopback and link-local addresses.
std::vector<std::string> own_addresses();
/// This machine's host name; empty when it has none.
std::string own_host_name();

}  // namespace limn::remote
