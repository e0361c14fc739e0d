#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/result.h"

namespace limn::exchange {

/// One argument of a message: its type letter as in OSC 1.0, and its value.
struct OscArgument {
  char type = 'i';
  std::variant<double, std::string> value = 0.0;  ///< a number (0 or 1 for F and T), or text

  std::optional<double> number() const;  ///< nullopt: text, true or false
  const std::string* text() const { return std::get_if<std::string>(&value); }
};

/// A message of Open Sound Control 1.0.
struct OscMessage {
  std::string path;
  std::vector<OscArgument> arguments;
};

/// Decodes one message. Error (it names the address if there is one): other bytes, a bundle, an argument that
/// is no number, text, true or false.
Result<OscMessage> parsed_osc(std::span<const std::uint8_t> datagram);

/// Whether it begins as a bundle of messages does.
bool is_osc_bundle(std::span<const std::uint8_t> datagram);

/// Whether the text is UTF-8 without control characters.
bool is_printable(const std::string& text);
/// The text as it may appear in a message to people, cut to 200 bytes.
std::string printable(const std::string& text);

/// Encodes a message.
using OscValue = std::variant<int, float, std::string>;
std::vector<std::uint8_t> osc_message(const std::string& path, const std::vector<OscValue>& arguments);

}  // namespace limn::exchange
