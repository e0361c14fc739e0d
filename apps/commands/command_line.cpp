#include "apps/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <new>
#include <opencv2/core.hpp>
#include <system_error>

#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/complete.h"
#include "apps/output_files.h"
#include "core/print.h"
#include "core/version.h"

namespace limn::apps {
namespace {

Error out_of_memory() {
  return error("expected enough memory for this work, found none left. Use smaller images.");
}

// Wrong usage if a file that the command would write is one that it reads. A value may name its file after
// "CAMERA=" or "FAMILY:".
Status check_files(const CLI::App& command) {
  static constexpr std::array k_outputs = {"--out", "--csv", "--json", "--draw", "--mount"};
  std::vector<NamedFile> outputs, inputs;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_items_expected_max() == 0) continue;  // a flag
    const std::string name = option->get_name();
    const bool is_output = std::find(k_outputs.begin(), k_outputs.end(), name) != k_outputs.end();
    for (const std::string& value : option->results()) {
      (is_output ? outputs : inputs).push_back({name.starts_with("-") ? name : "", value});
      for (const char separator : {'=', ':'})
        if (const auto at = value.find(separator); at != std::string::npos && !is_output)
          inputs.push_back({name, value.substr(at + 1)});
    }
  }
  return check_outputs(outputs, inputs);
}

Error bug(const std::exception& problem) {
  return error("this is a bug in Limn, please report it: {}", problem.what());
}

// `command` may be empty.
Error wrong_options(const CLI::ParseError& problem, const std::string& command) {
  std::string what = problem.what();
  if (!what.ends_with('.')) what += '.';
  return usage_error("{} Run limn{} --help for the options.", what, command.empty() ? "" : " " + command);
}

// `limn complete LIST WORDS…`, which the completions of the shells call: prints one candidate on each line.
void print_candidates(const std::string& list,
                      const std::vector<std::string>& words,
                      const std::vector<CLI::App*>& commands) {
  if (list == "commands")
    for (const CLI::App* command : commands) print_text(command->get_name() + "\n");
  else if (const auto candidates = completion_list(list, words))
    for (const std::string& candidate : *candidates) print_text(candidate + "\n");
}

int run_arguments(int argc, char** argv) {
  CLI::App app{"Limn paints virtual parts onto a physical prototype with light."};
  app.name("limn");
  app.set_version_flag("--version", fmt::format("limn {}", version()), "Print the version and exit");
  app.require_subcommand(1);
  Run run;
  // The order of a session. Each line is add_NAME(app, run).
  add_markers(app, run);
  add_detect(app, run);
  add_bench(app, run);
  add_demo(app, run);
  add_plan(app, run);
  add_patterns(app, run);
  add_capture(app, run);
  add_solve(app, run);
  add_calibrate(app, run);
  add_scan(app, run);
  add_recheck(app, run);
  add_align(app, run);
  add_deviation(app, run);
  add_render(app, run);
  add_export(app, run);
  add_import(app, run);
  add_check(app, run);
  add_live(app, run);
  add_room(app, run);
  add_node(app, run);
  add_replay(app, run);
  add_simulate(app, run);
  add_doctor(app, run);
  add_help(app, run);

  if (argc == 1) {
    print_text(app.help());
    return 2;
  }
  const auto commands = app.get_subcommands({});
  if (argc > 2 && std::string_view(argv[1]) == "complete") {
    print_candidates(argv[2], {argv + 3, argv + argc}, commands);
    return 0;
  }
  const auto is_named = [&](const CLI::App* command) { return argc > 1 && command->get_name() == argv[1]; };
  const bool is_known = std::any_of(commands.begin(), commands.end(), is_named);
  if (argc > 1 && argv[1][0] != '-' && !is_known) {
    std::string known;
    for (const CLI::App* command : commands) known += " " + command->get_name();
    return report_result(usage_error("unknown command '{}'; expected one of:{}.", argv[1], known));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    if (problem.get_exit_code() == 0) return app.exit(problem);  // --help, --version
    return report_result(wrong_options(problem, is_known ? argv[1] : ""));
  }
  try {
    for (const CLI::App* command = &app; !command->get_subcommands().empty();) {
      command = command->get_subcommands().front();
      if (const Status files = check_files(*command); !files) return report_result(files);
    }
    return run();
  } catch (const std::filesystem::filesystem_error& problem) {
    return report_result(
        error("{}: expected a file or folder that can be opened, found: {}. Check its name and permissions.",
              problem.path1().string(), problem.code().message()));
  } catch (const std::bad_alloc&) {
    return report_result(out_of_memory());
  } catch (const cv::Exception& problem) {
    if (problem.code == cv::Error::StsNoMem) return report_result(out_of_memory());
    return report_result(bug(problem));
  } catch (const std::system_error& problem) {
    if (problem.code() == std::errc::resource_unavailable_try_again)
      return report_result(
          error("expected another thread for this work, found none left. End other programs, "
                "or raise the limit (ulimit -u)."));
    return report_result(bug(problem));
  } catch (const std::exception& problem) {
    return report_result(bug(problem));
  }
}

}  // namespace

int run_command_line(int argc, char** argv) {
  const int code = run_arguments(argc, argv);
  const int output = report_result(flush_output());
  return code != 0 ? code : output;
}

}  // namespace limn::apps
