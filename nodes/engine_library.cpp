#include "nodes/engine_library.h"

#include "core/program_library.h"

namespace limn::nodes {

Result<void*> engine_function(const char* name) {
  return library_function({.file = "liblimn_room_dds.so",
                           .variable = "LIMN_ROOM_ENGINE",
                           .purpose = "the engine that connects the machines of a room and ROS 2",
                           .build_package = "cyclonedds-dev"},
                          name);
}

}  // namespace limn::nodes
