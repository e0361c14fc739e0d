#pragma once

#include <memory>

#include "core/result.h"
#include "nodes/engine.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// A message as a struct of limn_room.idl. It refers to texts and images of the message, which must outlive
/// it.
struct WireSample {
  Topic topic = Topic::offer;
  std::shared_ptr<const void> sample;
};

/// Converts a message, which must pass check_message(). Doubles keep their bits.
WireSample to_wire(const Message& message, const Sender& from);

}  // namespace limn::nodes
