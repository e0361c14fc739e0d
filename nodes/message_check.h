#pragma once

#include "core/result.h"
#include "nodes/messages.h"

namespace limn::nodes {

/// Checks a message before it is sent and after it has come: all numbers are finite, lists, texts and images
/// are not larger than a room needs, texts have no zero byte, sizes are not negative. What comes from another
/// machine is hostile until then. Error: the field, what was expected and what was found.
Status check_message(const Message& message);

/// Whether a name of a machine is valid: 1 to 64 letters (a to z), digits, "-", "_" and ".".
bool is_node_name(const std::string& name);

}  // namespace limn::nodes
