#pragma once

#include <vector>

#include "apps/doctor.h"
#include "apps/room.h"

namespace limn::apps {

/// The machines of a room, with their versions, monitors, cameras, clocks and delays. Listens for some
/// seconds.
std::vector<Finding> examined_room(const RoomOptions& options);

}  // namespace limn::apps
