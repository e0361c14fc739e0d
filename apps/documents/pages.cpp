// The manual pages and docs/commands.md.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "apps/documents/command_table.h"
#include "core/version.h"

namespace limn::apps {
namespace {

// Text that roff prints as it is.
std::string roff(const std::string& text) {
  std::string out;
  bool is_line_start = true;
  for (const char c : text) {
    if (is_line_start && (c == '.' || c == '\'')) out += "\\&";
    is_line_start = c == '\n';
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if (c == '^')
      out += "\\(ha";
    else if (c == '~')
      out += "\\(ti";
    else if (c == '\'')
      out += "\\(aq";
    else
      out += c;
  }
  return out;
}

std::string page_name(const std::string& command) {
  std::string name = command;
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string synopsis(const CommandRow& command) {
  std::string text = "[OPTIONS]";
  for (const OptionRow& argument : command.arguments) {
    const std::string name = argument.name() + (argument.may_repeat ? " ..." : "");
    text += argument.is_required ? " " + name : " [" + name + "]";
  }
  if (!command.commands.empty()) text += " [COMMAND]";
  return text;
}

// What a table says of an option beside its help.
std::string remarks(const OptionRow& option) {
  std::string text;
  if (option.is_required) text += " Required.";
  if (!option.present.empty()) text += " Default: " + option.present + ".";
  return text;
}

std::string man_options(const std::vector<OptionRow>& options) {
  std::string text;
  for (const OptionRow& option : options) {
    std::string names;
    for (const std::string& name : option.names)
      names += (names.empty() ? "" : ", ") + ("\\fB" + roff(name) + "\\fR");
    const std::string value = value_text(option);
    if (!value.empty()) names += " \\fI" + roff(value) + "\\fR";
    text += fmt::format(".TP\n{}\n{}\n", names, roff(option.help + "." + remarks(option)));
  }
  return text;
}

std::string with_capitals(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

// What the words for the values of a command's options mean.
std::string man_files(const CommandRow& command) {
  static const std::vector<std::pair<std::string, std::string>> k_words = {
      {"RIG", "A rig: rig.json, NAME.cameramodel of each camera and projector, response.json, report.json."},
      {"SCENE", "A scene: scene.json, and the meshes and looks that it names."},
      {"CAPTURES", "Captures: capture.json, patterns.json, poseNN/CAMERA/NNN.png."}};
  std::string text;
  for (const auto& entry : k_words) {
    const auto& [word, meaning] = entry;
    const auto has = [&entry](const OptionRow& option) { return option.value == entry.first; };
    if (std::ranges::any_of(command.options, has) || std::ranges::any_of(command.arguments, has))
      text += fmt::format(".TP\n\\fI{}\\fR\n{}\n", word, roff(meaning));
  }
  return text + ".TP\n\\fI~/.config/limn\\fR\n" +
         roff("Settings, rooms and certificates of this user ($XDG_CONFIG_HOME/limn).") +
         "\n.TP\n\\fI~/.local/share/limn\\fR\n" +
         roff("Looks, pairings and comments of scenes that this user cannot write ($XDG_DATA_HOME/limn).") +
         "\n";
}

// The day of the release, so that two builds give the same pages: the one that SOURCE_DATE_EPOCH states
// (reproducible-builds.org), else that of CHANGELOG.md; empty before a release.
std::string document_date() {
  const char* stated = std::getenv("SOURCE_DATE_EPOCH");
  std::int64_t seconds = 0;
  if (!stated || std::from_chars(stated, stated + std::strlen(stated), seconds).ec != std::errc())
    return LIMN_RELEASED;
  const std::chrono::sys_seconds moment{std::chrono::seconds(seconds)};
  const std::chrono::year_month_day day(std::chrono::floor<std::chrono::days>(moment));
  return fmt::format("{:04}-{:02}-{:02}", int(day.year()), unsigned(day.month()), unsigned(day.day()));
}

}  // namespace

std::string man_page(const CommandRow& command, const CommandRow& table) {
  const std::string name = page_name(command.name);
  std::string text = fmt::format(".TH \"{}\" 1 \"{}\" \"limn {}\" \"Limn\"\n.SH NAME\n{} \\- {}\n",
                                 with_capitals(roff(name)), roff(document_date()), version(), roff(name),
                                 roff(command.summary));
  text += fmt::format(".SH SYNOPSIS\n\\fB{}\\fR {}\n", roff(command.name), roff(synopsis(command)));
  text += fmt::format(".SH DESCRIPTION\n{}.\n", roff(command.summary));
  if (!command.details.empty()) text += ".PP\n" + roff(command.details) + "\n";
  if (!command.commands.empty()) {
    text += ".SH COMMANDS\n";
    for (const CommandRow& inner : command.commands)
      text += fmt::format(".TP\n\\fB{}\\fR(1)\n{}\n", roff(page_name(inner.name)), roff(inner.summary));
  }
  text += ".SH OPTIONS\n" + man_options(command.arguments) + man_options(command.options);
  if (!command.examples.empty()) {
    text += ".SH EXAMPLES\n";
    std::string separator;
    for (const std::string& example : command.examples) {
      text += separator + roff(example) + "\n";
      separator = ".PP\n";
    }
  }
  text += ".SH FILES\n" + man_files(command);
  text +=
      ".SH EXIT STATUS\n.TP\n\\fB0\\fR\nSuccess.\n.TP\n\\fB1\\fR\nThe work failed.\n.TP\n\\fB2\\fR\nWrong "
      "usage.\n";
  text += ".SH SEE ALSO\n";
  std::string others;
  const auto add = [&](const CommandRow& other) {
    if (other.name != command.name)
      others += (others.empty() ? "" : ",\n") + fmt::format("\\fB{}\\fR(1)", roff(page_name(other.name)));
  };
  add(table);
  const bool is_table = command.name == table.name;
  for (const CommandRow& inner : is_table ? table.commands : command.commands) add(inner);
  return text + others + "\n";
}

namespace {

std::string markdown_cell(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '|' || c == '<' || c == '*' || c == '_') out += '\\';
    out += c;
  }
  return out;
}

std::string markdown_options(const CommandRow& command) {
  std::string text = "| option | what |\n|---|---|\n";
  for (const auto* rows : {&command.arguments, &command.options}) {
    for (const OptionRow& option : *rows) {
      std::string names = fmt::format("{}", fmt::join(option.names, ", "));
      if (const std::string value = value_text(option); !value.empty() && names != value)
        names += " " + value;
      std::string cell;  // also inside `code` a bar would end the cell
      for (const char c : names) cell += c == '|' ? std::string("\\|") : std::string(1, c);
      text +=
          fmt::format("| `{}` | {}.{} |\n", cell, markdown_cell(option.help), markdown_cell(remarks(option)));
    }
  }
  return text;
}

}  // namespace

std::string markdown_page(const CommandRow& table) {
  std::string text =
      "# Commands\n\n"
      "All commands and options. This page is made from the table of commands; "
      "`./limn help --format markdown --out docs` writes it again.\n"
      "Exit codes: 0 success, 1 the work failed, 2 wrong usage.\n";
  for (const CommandRow* command : all_commands(table)) {
    text += fmt::format("\n## {}\n\n{}.\n\n    {} {}\n\n", command->name, markdown_cell(command->summary),
                        command->name, synopsis(*command));
    if (!command->details.empty()) text += markdown_cell(command->details) + "\n\n";
    text += markdown_options(*command);
    if (!command->examples.empty()) text += "\nExamples:\n\n";
    for (const std::string& example : command->examples) text += "    " + example + "\n";
  }
  return text;
}

}  // namespace limn::apps
