#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/result.h"
#include "scene/actions.h"

namespace limn::apps {

/// An address of Open Sound Control 1.0 that a live session hears or tells on.
struct OscAddress {
  std::string path;       ///< "/limn/next_variant"
  std::string arguments;  ///< in words, as docs/osc.md has them
  std::string what;
  std::string role = {};  ///< that the action needs on the remote; nobody asks for it here
};

/// What a session hears: one for each of scene::actions(), in their order.
std::vector<OscAddress> osc_heard();
/// What it tells.
const std::vector<OscAddress>& osc_told();

/// The longest datagram that is looked at, bytes.
constexpr std::size_t k_longest_osc = 1024;

/// The edit that a datagram asks for. Slots, variants and looks are the scene's affair (scene::edited).
/// Error, naming the address where there is one: no message of OSC, a bundle, longer than k_longest_osc, an
/// unknown address, arguments of other number or type than the action takes, numbers that are not finite,
/// text that is not printable or longer than 200 bytes.
Result<scene::Edit> edit_of_osc(std::span<const std::uint8_t> datagram);

/// A message as bytes.
using OscValue = std::variant<int, float, std::string>;
std::vector<std::uint8_t> osc_message(const std::string& path, const std::vector<OscValue>& arguments);

}  // namespace limn::apps
