#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>

#include "apps/bench.h"
#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/commands/read_table.h"
#include "core/file.h"
#include "core/names.h"
#include "core/print.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

constexpr EnumNames<DocumentFormat, 6> k_document_formats{{"text", "man", "markdown", "bash", "zsh", "fish"}};

struct HelpOptions {
  std::vector<std::string> command;  // empty: the program itself
  DocumentFormat format = DocumentFormat::text;
  fs::path out;  // folder; empty: standard output
};

// A command, and its name with those of the commands before it.
struct Found {
  const CLI::App* command = nullptr;
  std::string name;
};

Result<Found> find_command(const CLI::App& program, const std::vector<std::string>& words) {
  Found found{&program, program.get_name()};
  for (const std::string& word : words) {
    const auto inner = found.command->get_subcommands({});
    const auto next = std::ranges::find(inner, word, [](const CLI::App* app) { return app->get_name(); });
    if (next == inner.end()) {
      const auto benches = bench_names();
      const bool is_bench = found.command->get_name() == "bench" && std::ranges::count(benches, word) > 0;
      if (is_bench) return found;  // a bench's options belong to it
      std::vector<std::string> known;
      for (const CLI::App* app : inner) known.push_back(app->get_name());
      if (found.command->get_name() == "bench") known.assign(benches.begin(), benches.end());
      return usage_error("help: unknown command '{}'; expected one of: {}.", fmt::join(words, " "),
                         joined_names(known));
    }
    found.command = *next;
    found.name += " " + word;
  }
  return found;
}

// The files of a format, each with its name.
std::vector<std::pair<std::string, std::string>> documents(const CommandRow& table, DocumentFormat format) {
  switch (format) {
    case DocumentFormat::bash:
      return {{"limn", bash_completions(table)}};
    case DocumentFormat::zsh:
      return {{"_limn", zsh_completions(table)}};
    case DocumentFormat::fish:
      return {{"limn.fish", fish_completions(table)}};
    case DocumentFormat::markdown:
      return {{"commands.md", markdown_page(table)}};
    default:
      break;
  }
  std::vector<std::pair<std::string, std::string>> pages;
  for (const CommandRow* command : all_commands(table)) {
    std::string name = command->name + ".1";
    std::ranges::replace(name, ' ', '-');
    pages.emplace_back(name, man_page(*command, table));
  }
  return pages;
}

Status print_help(const CLI::App& program, const HelpOptions& options) {
  LIMN_TRY(const Found found, find_command(program, options.command));
  if (options.format == DocumentFormat::text) {
    if (!options.out.empty()) return usage_error("help --out: expected --format man or another one with it.");
    // Not help(), which writes the help of the command that was parsed.
    print_text(
        found.command->get_formatter()->make_help(found.command, found.name, CLI::AppFormatMode::Normal));
    return {};
  }
  const CommandRow table = read_table(program, program.get_name());
  if (options.out.empty() && options.format == DocumentFormat::man) {
    print_text(man_page(read_table(*found.command, found.name), table));
    return {};
  }
  for (const auto& [name, text] : documents(table, options.format)) {
    if (options.out.empty())
      print_text(text);
    else
      LIMN_TRY_STATUS(write_file(options.out / name, text));
  }
  return {};
}

}  // namespace

void add_help(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("help", "Print the help of a command, or write the documents of all commands");
  command->footer(
      "The documents are man (manual pages), markdown (docs/commands.md), and bash, zsh and fish "
      "(completions).\n"
      "Example: limn help room create\n"
      "Example: limn help --format bash > ~/.local/share/bash-completion/completions/limn\n"
      "Example: limn help --format man --out ~/.local/share/man/man1");
  auto options = std::make_shared<HelpOptions>();
  command
      ->add_option("command", options->command,
                   "The command, with the commands inside it; without it the program itself")
      ->type_name("COMMAND");
  add_choice(command, "--format", &options->format, k_document_formats,
             "How the help is written: text, or as a document");
  command
      ->add_option(
          "--out", options->out,
          "Folder for the document's files, for man one for each command; without it the document is "
          "printed, for man the command's page")
      ->type_name("FOLDER");
  command->callback(
      [options, &app, &run] { run = [options, &app] { return report_result(print_help(app, *options)); }; });
}

}  // namespace limn::apps
