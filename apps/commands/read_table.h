#pragma once

#include "apps/documents/command_table.h"

namespace CLI {
class App;
}

namespace limn::apps {

/// The table of commands as rows: the documents of a command that was added to the program, and of those
/// inside it. `name`: the command with those before it, such as `limn room`.
CommandRow read_table(const CLI::App& command, const std::string& name);

}  // namespace limn::apps
