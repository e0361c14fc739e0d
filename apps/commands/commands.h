#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace limn::apps {

/// Runs the chosen command and returns the exit code.
using Run = std::function<int()>;

// Each adds a command to the program: its name, options, help and examples. When the command is parsed, `run`
// becomes what it does. This is the table of commands: the help, the man pages, the completions of the shells
// and docs/commands.md are made from it (apps/commands/read_table.h, apps/documents/).

void add_markers(CLI::App& app, Run& run);
void add_detect(CLI::App& app, Run& run);
void add_bench(CLI::App& app, Run& run);
void add_demo(CLI::App& app, Run& run);
void add_plan(CLI::App& app, Run& run);
void add_patterns(CLI::App& app, Run& run);
void add_capture(CLI::App& app, Run& run);
void add_solve(CLI::App& app, Run& run);
void add_calibrate(CLI::App& app, Run& run);
void add_scan(CLI::App& app, Run& run);
void add_recheck(CLI::App& app, Run& run);
void add_align(CLI::App& app, Run& run);
void add_deviation(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_export(CLI::App& app, Run& run);
void add_import(CLI::App& app, Run& run);
void add_check(CLI::App& app, Run& run);
void add_live(CLI::App& app, Run& run);
void add_room(CLI::App& app, Run& run);
void add_node(CLI::App& app, Run& run);
void add_replay(CLI::App& app, Run& run);
void add_simulate(CLI::App& app, Run& run);
void add_doctor(CLI::App& app, Run& run);
void add_help(CLI::App& app, Run& run);

}  // namespace limn::apps
