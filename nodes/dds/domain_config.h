#pragma once

#include <string>

#include "core/result.h"
#include "nodes/engine.h"

namespace limn::nodes {

/// Cyclone DDS's configuration of a room's domain, as XML. IPv6 is used where peers or interfaces have no
/// IPv4 address. Error: a peer has no address, peers are of both kinds, an interface does not exist, or no
/// network is up.
Result<std::string> domain_config(const EngineOptions& options);

}  // namespace limn::nodes
