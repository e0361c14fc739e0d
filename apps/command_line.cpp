#include "apps/command_line.h"

#include <CLI/CLI.hpp>
#include <functional>

#include "core/log.h"

namespace limn::apps {
namespace {

// What a chosen command does; returns the exit code.
using Run = std::function<int()>;

int finished(const Status& status) {
  if (status) return 0;
  log_warning("limn: {}", status.message());
  return status.error().wrong_usage ? 2 : 1;
}

}  // namespace

int run_command_line(int argc, char** argv) {
  CLI::App app{"Limn paints virtual parts onto a physical prototype with light."};
  app.name("limn");
  app.require_subcommand(1);
  Run run;
  // One block per command, in the order of a session: add_NAME(app, run).

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  try {
    return run();
  } catch (const std::exception& bug) {
    return finished(error("this is a bug in Limn, please report it: {}", bug.what()));
  }
}

}  // namespace limn::apps
