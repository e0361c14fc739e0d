#pragma once

#include <string>
#include <vector>

namespace limn::remote {

/// Whether a numeric address is this machine's own, which nobody else can reach: 127.0.0.0/8 and ::1.
bool is_loopback(const std::string& address);
/// Whether it stands for all addresses of the machine: 0.0.0.0 and ::.
bool is_unspecified(const std::string& address);

/// Numeric addresses of this machine in networks, IPv4 first; without the loopback and link-local ones.
std::vector<std::string> own_addresses();
/// The machine's name; empty when it has none.
std::string own_host_name();

}  // namespace limn::remote
