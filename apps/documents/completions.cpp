// The completions of bash, zsh and fish. Lists that only the program knows come from `limn complete LIST`.

#include <fmt/format.h>

#include "apps/documents/command_table.h"

namespace limn::apps {
namespace {

constexpr const char* k_note = "# Made by `limn help --format` from the table of commands.\n";

std::string inner_name(const CommandRow& command) { return command.name.substr(command.name.find(' ') + 1); }

std::string last_word(const std::string& name) { return name.substr(name.rfind(' ') + 1); }

std::string words_of(const std::vector<CommandRow>& commands) {
  std::string words;
  for (const CommandRow& command : commands) words += (words.empty() ? "" : " ") + last_word(command.name);
  return words;
}

// Text between single quotes of a shell (`end` closes and opens them around a quote).
std::string in_quotes(const std::string& text, const char* quote = "'\\''") {
  std::string out;
  for (const char c : text) out += c == '\'' ? quote : std::string(1, c);
  return "'" + out + "'";
}

// ---- bash

std::string bash_value(const OptionRow& option) {
  const std::string after_comma = option.has_commas ? "_limn_after_comma; " : "";
  if (!option.choices.empty())
    return after_comma + fmt::format("_limn_words '{}'", fmt::join(option.choices, " "));
  const ValueKind kind = value_kind(option.value);
  switch (kind.what) {
    case ValueKind::files:
      return fmt::format("_limn_files '{}'", fmt::join(kind.extensions, "|"));
    case ValueKind::folders:
      return "_limn_folders";
    case ValueKind::known:
      return after_comma + "_limn_list " + kind.list;
    default:
      return ":";
  }
}

std::string bash_case(const CommandRow& command, const std::string& pattern) {
  std::string values, options, lists;
  for (const OptionRow& option : command.options) {
    options += fmt::format("{} ", fmt::join(option.names, " "));
    if (option.may_repeat) lists += fmt::format("{} ", fmt::join(option.names, " "));
    if (!option.value.empty())
      values += fmt::format("        {}) {}; return ;;\n", fmt::join(option.names, "|"), bash_value(option));
  }
  std::string text = fmt::format("    {})\n      options='{}'\n", pattern, options);
  if (!lists.empty()) text += fmt::format("      _limn_list_option ' {}'\n", lists);
  if (!values.empty()) text += "      case $previous in\n" + values + "      esac\n";
  std::string rest = command.arguments.empty() ? "" : bash_value(command.arguments.front());
  if (!command.commands.empty())
    rest += (rest.empty() ? "" : "; ") + fmt::format("_limn_words '{}'", words_of(command.commands));
  if (!rest.empty()) text += fmt::format("      [[ $word == -* ]] || {{ {}; return; }}\n", rest);
  return text + "      ;;\n";
}

// ---- zsh

std::string zsh_value(const OptionRow& option) {
  if (!option.choices.empty()) return fmt::format("({})", fmt::join(option.choices, " "));
  const ValueKind kind = value_kind(option.value);
  switch (kind.what) {
    case ValueKind::files:
      return kind.extensions.empty() ? "_files"
                                     : fmt::format("_files -g \"*.({})\"", fmt::join(kind.extensions, "|"));
    case ValueKind::folders:
      return "_files -/";
    case ValueKind::known:
      return "_limn_list " + kind.list;
    default:
      return " ";
  }
}

std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_function(const CommandRow& command) {
  std::string name = command.name;
  for (char& c : name) c = c == ' ' ? '_' : c;
  std::string text = fmt::format("_{}_options() {{\n  _arguments -S", name);
  for (const OptionRow& option : command.options)
    for (const std::string& spelling : option.names) {
      std::string spec =
          fmt::format("{}{}[{}]", option.value.empty() ? "" : "*", spelling, zsh_text(option.help));
      if (!option.value.empty()) spec += fmt::format(":{}:{}", zsh_text(option.value), zsh_value(option));
      text += " \\\n    " + in_quotes(spec);
    }
  if (!command.commands.empty())
    text += fmt::format(" \\\n    '1:command:({})'", words_of(command.commands));
  else
    for (const OptionRow& argument : command.arguments)
      text += " \\\n    " + in_quotes(fmt::format("*:{}:{}", zsh_text(argument.name()), zsh_value(argument)));
  return text + "\n}\n";
}

// ---- fish

std::string fish_value(const OptionRow& option) {
  if (!option.choices.empty()) return fmt::format(" -x -a '{}'", fmt::join(option.choices, " "));
  const ValueKind kind = value_kind(option.value);
  switch (kind.what) {
    case ValueKind::files:
      if (kind.extensions.empty()) return " -r -F";
      {
        std::string calls;
        for (const std::string& extension : kind.extensions)
          calls += (calls.empty() ? "" : "; ") + ("__fish_complete_suffix ." + extension);
        return fmt::format(" -x -a '({})'", calls);
      }
    case ValueKind::folders:
      return " -x -a '(__fish_complete_directories)'";
    case ValueKind::known:
      return fmt::format(" -x -a '(__limn_list {})'", kind.list);
    default:
      return " -x";
  }
}

}  // namespace

std::string bash_completions(const CommandRow& table) {
  std::string text = k_note;
  text += R"script(_limn_words() { COMPREPLY+=($(compgen -P "$done" -W "$1" -- "$word")); }
# Of values that are separated by commas only the last one is completed.
_limn_after_comma() { done=${word%"${word##*,}"} word=${word##*,}; }
# A later value of an option that takes several words: the option is the last word with a hyphen.
_limn_list_option() {
  local at=$((${#words[@]} - 2))
  while ((at > 1)) && [[ ${words[at]} != -* ]]; do ((at--)); done
  [[ $word != -* && $1 == *" ${words[at]} "* ]] && previous=${words[at]}
}
_limn_folders() { compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -d -- "$word"); }
# Files with one of these extensions (a|b), and folders.
_limn_files() {
  compopt -o filenames 2>/dev/null
  local file
  while IFS= read -r file; do
    [[ -z $1 || -d $file || $file =~ \.($1)$ ]] && COMPREPLY+=("$file")
  done < <(compgen -f -- "$word")
}
_limn_list() { _limn_words "$("${words[0]}" complete "$1" "${words[@]:1}" 2>/dev/null)"; }
_limn() {
  # Bash divides the line at "=", too, so it is divided again here.
  local words word previous command options='' done=''
  read -ra words <<<"${COMP_LINE:0:COMP_POINT}"
  [[ ${COMP_LINE:0:COMP_POINT} == *' ' ]] && words+=('')
  word=${words[-1]} previous=${words[-2]} command=${words[1]}
  [[ $word == --*=* ]] && previous=${word%%=*} word=${word#*=}
  COMPREPLY=()
  _limn_candidates
  word=$done$word
  [[ $word == *=* && $COMP_WORDBREAKS == *=* ]] && COMPREPLY=("${COMPREPLY[@]#"${word%=*}="}")
}
_limn_candidates() {
  ((${#words[@]} == 2)) && command=''
  ((${#words[@]} > 3)) && case "$command ${words[2]}" in
)script";
  std::string nested, cases;
  for (const CommandRow* command : all_commands(table)) {
    const bool is_program = command->name == table.name;
    const std::string name = is_program ? "" : inner_name(*command);
    if (name.find(' ') != std::string::npos) nested += (nested.empty() ? "" : "|") + in_quotes(name);
    cases += bash_case(*command, in_quotes(name));
  }
  text += fmt::format("    {}) command+=\" ${{words[2]}}\" ;;\n  esac\n  case $command in\n{}  esac\n",
                      nested, cases);
  return text + "  _limn_words \"$options\"\n}\ncomplete -F _limn limn ./limn\n";
}

std::string zsh_completions(const CommandRow& table) {
  std::string text = std::string("#compdef limn\n") + k_note;
  text += "_limn_list() { compadd -- ${(f)\"$($_limn_program complete $1 $words[2,-1] 2>/dev/null)\"} }\n";
  for (const CommandRow* command : all_commands(table)) text += zsh_function(*command);
  text += "_limn() {\n  local _limn_program=$words[1]\n  case \"$words[2] $words[3]\" in\n";
  std::string single;
  for (const CommandRow* command : all_commands(table)) {
    if (command->name == table.name) continue;
    const std::string inner = inner_name(*command);
    const auto space = inner.find(' ');
    if (space == std::string::npos)
      single += fmt::format("    '{} '*) shift words; ((CURRENT--)); _limn_{}_options ;;\n", inner, inner);
    else
      text += fmt::format(
          "    '{}') ((CURRENT > 3)) && {{ shift 2 words; ((CURRENT -= 2)); _limn_{}_{}_options; return }}; "
          "shift words; ((CURRENT--)); _limn_{}_options ;;\n",
          inner, inner.substr(0, space), inner.substr(space + 1), inner.substr(0, space));
  }
  text += "    *) ;;\n  esac\n";
  // While the command itself is typed, its name is not complete.
  const auto cases = text.rfind("  case \"$words[2]");
  text.insert(cases, "  ((CURRENT == 2)) && { _limn_options; return }\n");
  const auto rest = text.rfind("    *) ;;\n");
  text.insert(rest, single);
  return text + "}\n_limn \"$@\"\n";
}

std::string fish_completions(const CommandRow& table) {
  std::string text = k_note;
  text += R"script(# Whether the words before the cursor begin with this command.
function __limn_at
  set -l words (commandline -opc)
  set -l last (math 1 + (count $argv))
  test (count $words) -ge $last; or return 1
  test (count $argv) -eq 0; or test "$words[2..$last]" = "$argv"
end
function __limn_list
  set -l words (commandline -opc)
  $words[1] complete $argv $words[2..-1] 2>/dev/null
end
complete -c limn -f
)script";
  for (const CommandRow* command : all_commands(table)) {
    const bool is_program = command->name == table.name;
    std::string here =
        is_program ? "test (count (commandline -opc)) -eq 1" : "__limn_at " + inner_name(*command);
    if (!is_program)
      for (const CommandRow& inner : command->commands) here += "; and not __limn_at " + inner_name(inner);
    for (const CommandRow& inner : command->commands)
      text += fmt::format("complete -c limn -n {} -f -a {} -d {}\n", in_quotes(here, "\\'"),
                          last_word(inner.name), in_quotes(inner.summary, "\\'"));
    for (const OptionRow& option : command->options) {
      std::string names;
      for (const std::string& name : option.names)
        names += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      text += fmt::format("complete -c limn -n {}{}{} -d {}\n", in_quotes(here, "\\'"), names,
                          option.value.empty() ? " -f" : fish_value(option), in_quotes(option.help, "\\'"));
    }
    for (const OptionRow& argument : command->arguments)
      if (value_kind(argument.value).what != ValueKind::free)
        text += fmt::format("complete -c limn -n {}{}\n", in_quotes(here, "\\'"), [&] {
          const std::string value = fish_value(argument);
          return value == " -r -F" ? std::string(" -F") : " -f" + value.substr(3);
        }());
  }
  return text;
}

}  // namespace limn::apps
