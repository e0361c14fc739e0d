#pragma once

#include <cstdint>
#include <string>

#include "nodes/messages.h"

namespace limn::test {

/// A message of a kind (the index in nodes::Message, Departure excluded) with random fields of all kinds of
/// values: tiny and negative numbers, negative zero, empty and long lists. Each seed always gives the same
/// message. It is for the machine `to`.
nodes::Message random_message(std::size_t kind, std::uint64_t seed, const std::string& to);

/// The kind of a message's type.
template <class Kind>
std::size_t kind_of() {
  return nodes::Message(Kind{}).index();
}

/// All fields as text; doubles with all their bits. Equal texts mean equal messages.
std::string to_text(const nodes::Message& message);

/// A moment of about that many bytes on the wire.
nodes::Moment moment_of_size(std::size_t bytes, std::uint64_t number);

}  // namespace limn::test
