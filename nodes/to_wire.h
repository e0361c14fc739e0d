#pragma once

#include <memory>

#include "core/result.h"
#include "nodes/engine.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// A message as a struct of limn_room.idl. It refers to texts and images of the message, and to the name of
/// its sender: both must outlive it.
struct WireSample {
  Topic topic = Topic::offer;
  std::shared_ptr<const void> sample;
};

/// Converts a message that passes check_message(). Doubles keep their bits.
WireSample to_wire(const Message& message, const Sender& from);
WireSample to_wire(Message&& message, const Sender& from) = delete;

}  // namespace limn::nodes
