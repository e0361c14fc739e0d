#pragma once

#include "core/result.h"
#include "nodes/engine.h"
#include "nodes/room_link.h"

namespace limn::nodes {

/// The message and sender in a struct of limn_room.idl, `sample`. Doubles keep their bits. Error: the
/// sender's name, an enumerator, a lens or an image is not valid, or the message does not pass
/// check_message().
Result<Received> from_wire(Topic topic, const void* sample, Stamp arrived_at);

}  // namespace limn::nodes
