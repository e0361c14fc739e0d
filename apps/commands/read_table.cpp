#include "apps/commands/read_table.h"

#include <CLI/CLI.hpp>
#include <sstream>

namespace limn::apps {
namespace {

// The words of a closed set, which ends the description of a value: "TEXT:{gray,phase,xor}".
std::vector<std::string> choices_in(const std::string& type) {
  const auto begin = type.find(":{");
  if (begin == std::string::npos || type.back() != '}') return {};
  std::istringstream words(type.substr(begin + 2, type.size() - begin - 3));
  std::vector<std::string> all;
  for (std::string word; std::getline(words, word, ',');) all.push_back(word);
  return all;
}

OptionRow read_option(const CLI::Option& option) {
  OptionRow row;
  for (const std::string& name : option.get_snames()) row.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) row.names.push_back("--" + name);
  if (row.names.empty()) row.names.push_back(option.get_name());
  row.help = option.get_description();
  row.is_required = option.get_required();
  if (option.get_items_expected_max() == 0) return row;  // a flag
  const std::string type = option.get_type_name();
  row.value = type.substr(0, type.find(':'));
  row.choices = choices_in(type);
  row.present = option.get_default_str();
  if (row.present == "[]" || row.present == "\"\"") row.present.clear();
  row.may_repeat = option.get_items_expected_max() > 1;
  row.has_commas = option.get_delimiter() == ',';
  return row;
}

// The details and the examples: text whose lines were broken for the terminal, and lines "Example: …".
void read_footer(const std::string& footer, CommandRow* row) {
  static const std::string k_example = "Example: ";
  std::istringstream lines(footer);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(k_example))
      row->examples.push_back(line.substr(k_example.size()));
    else
      row->details += (row->details.empty() ? "" : " ") + line;
  }
}

}  // namespace

CommandRow read_table(const CLI::App& command, const std::string& name) {
  CommandRow row;
  row.name = name;
  row.summary = command.get_description();
  if (row.summary.ends_with('.')) row.summary.pop_back();
  read_footer(command.get_footer(), &row);
  for (const CLI::Option* option : command.get_options())
    (option->get_positional() ? row.arguments : row.options).push_back(read_option(*option));
  for (const CLI::App* inner : command.get_subcommands({}))
    row.commands.push_back(read_table(*inner, name + " " + inner->get_name()));
  return row;
}

}  // namespace limn::apps
