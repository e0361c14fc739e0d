#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/poses/osc_message.h"
#include "scene/actions.h"

namespace limn::session {

/// An address of Open Sound Control 1.0 that a live session receives or sends.
struct OscAddress {
  std::string path;       ///< "/limn/next_variant"
  std::string arguments;  ///< in words, as in docs/osc.md
  std::string what;
  /// The role that the action needs on the remote; OSC does not check it.
  std::string role = {};
};

/// The addresses that a session receives: one for each of scene::actions(), in their order.
std::vector<OscAddress> osc_received();
/// The addresses that a session sends.
const std::vector<OscAddress>& osc_sent();

/// Longer datagrams are refused; bytes.
constexpr std::size_t k_longest_osc = 1024;

/// The edit that a datagram requests. Whether its slot, variant or look exists is not checked here, but in
/// scene::command_of and apply_edit. Error (it names the address if there is one): not a message of OSC, a
/// bundle, longer than k_longest_osc, an unknown address, another number or type of arguments than the action
/// takes, numbers that are not finite, text that is not printable or longer than 200 bytes.
Result<scene::Edit> edit_of_osc(std::span<const std::uint8_t> datagram);

using exchange::osc_message;
using exchange::OscValue;

}  // namespace limn::session
