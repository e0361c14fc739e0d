#pragma once

#include <string>
#include <vector>

namespace limn::apps {

/// An option, or an argument without a name of its own, as the table of commands declares it.
struct OptionRow {
  std::vector<std::string> names;    ///< `-h` and `--help`; for an argument one name without hyphens
  std::string value;                 ///< word for the value: `FILE.json`, `FAMILY`; empty: a flag
  std::vector<std::string> choices;  ///< the words that are accepted; empty: not a closed set
  std::string present;               ///< default; empty: none is stated
  std::string help;
  bool is_required = false;
  bool may_repeat = false;  ///< may have several values: one word each, or the option again for each
  bool has_commas = false;  ///< several values may be one word, separated by commas

  /// The longest name.
  const std::string& name() const { return names.back(); }
};

/// A command, as the table declares it.
struct CommandRow {
  std::string name;  ///< with the commands before it: `limn`, `limn room create`
  std::string summary;
  std::string details;                ///< what the help says beside options and examples; may be empty
  std::vector<std::string> examples;  ///< with a remark in parentheses where there is one
  std::vector<OptionRow> arguments, options;
  std::vector<CommandRow> commands;  ///< the commands inside
};

/// How documents are written.
enum class DocumentFormat { text, man, markdown, bash, zsh, fish };

/// A command and all commands inside it, the outer ones first.
std::vector<const CommandRow*> all_commands(const CommandRow& table);

/// The word of a closed set, `gray|phase|xor`, or else the word for the value.
std::string value_text(const OptionRow& option);

/// The manual page of a command in roff; `limn` has the list of all commands.
std::string man_page(const CommandRow& command, const CommandRow& table);
/// docs/commands.md.
std::string markdown_page(const CommandRow& table);
/// The completions of a shell.
std::string bash_completions(const CommandRow& table);
std::string zsh_completions(const CommandRow& table);
std::string fish_completions(const CommandRow& table);

/// What may follow an option whose value is this word.
struct ValueKind {
  enum What { free, files, folders, known } what = free;
  std::vector<std::string> extensions = {};  ///< Extensions of the files without a dot; empty: all files.
  std::string list = {};                     ///< For `known`: the list that `limn complete` prints.
};
ValueKind value_kind(const std::string& word);

}  // namespace limn::apps
