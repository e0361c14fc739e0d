#pragma once

namespace limn::apps {

/// The whole program: parses the command line and runs the command. Returns the exit code: 0 success, 1 the
/// work failed, 2 wrong usage. Never throws.
int run_command_line(int argc, char** argv);

}  // namespace limn::apps
