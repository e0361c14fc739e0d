// Tests that every command and option of the table is in all documents that are made from it, and that the
// shells complete.

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

// What `help COMMAND` lists: the commands inside, and the options.
struct Listed {
  std::vector<std::string> commands;
  Names options;
};

Listed listed(const std::vector<std::string>& command) {
  std::vector<std::string> words = {"help"};
  words.insert(words.end(), command.begin(), command.end());
  std::istringstream lines(test::run_limn(words).out);
  static const std::regex option(R"(^  (?:-\w,)?(--[a-z-]+))"), inner(R"(^  ([a-z]+)\s)");
  Listed found;
  bool has_commands = false, has_options = false;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(' ')) has_commands = line == "Subcommands:", has_options = line == "Options:";
    std::smatch match;
    if (has_options && std::regex_search(line, match, option)) found.options.insert(match[1]);
    if (has_commands && std::regex_search(line, match, inner)) found.commands.push_back(match[1]);
  }
  return found;
}

void collect(const std::vector<std::string>& command, std::map<std::string, Listed>* all) {
  const Listed found = listed(command);
  all->emplace(fmt::format("{}", fmt::join(command, " ")), found);
  for (const std::string& inner : found.commands) {
    auto words = command;
    words.push_back(inner);
    collect(words, all);
  }
}

const std::map<std::string, Listed>& table() {
  static const std::map<std::string, Listed> all = [] {
    std::map<std::string, Listed> commands;
    collect({}, &commands);
    return commands;
  }();
  return all;
}

std::string document(const std::string& format) { return test::run_limn({"help", "--format", format}).out; }

// What a shell command prints, without the last line break.
std::string output_of(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  std::string text;
  std::array<char, 4096> part{};
  while (const std::size_t count = std::fread(part.data(), 1, part.size(), pipe))
    text.append(part.data(), count);
  pclose(pipe);
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

bool has_program(const std::string& name) {
  return !output_of("command -v " + name + " 2>/dev/null").empty();
}

// A help without the lists of options that exclude each other, which come in any order.
std::string without_excluded(const std::string& help) {
  static const std::regex list("Excludes:[^\n]*");
  return std::regex_replace(help, list, "");
}

TEST(Table, HelpOfACommandIsWhatItsHelpOptionPrints) {
  EXPECT_GT(table().size(), 24u);
  for (const auto& [name, found] : table()) {
    std::vector<std::string> words = {"help"}, asked;
    std::istringstream names(name);
    for (std::string word; names >> word;) words.push_back(word), asked.push_back(word);
    asked.push_back("--help");
    EXPECT_EQ(without_excluded(test::run_limn(words).out), without_excluded(test::run_limn(asked).out))
        << name;
  }
  EXPECT_EQ(test::run_limn({"help", "bench", "calib"}).out, test::run_limn({"bench", "--help"}).out);
  EXPECT_EQ(test::run_limn({"help", "levitate"}).code, 2);
  EXPECT_EQ(test::run_limn({"help", "bench", "levitate"}).code, 2);
}

// Debian's tools state the time of the package's entry, so that two builds give the same pages.
TEST(Table, AManualPageHasTheDateThatTheBuildStates) {
  ::setenv("SOURCE_DATE_EPOCH", "1795780800", 1);
  const std::string page = test::run_limn({"help", "--format", "man"}).out;
  ::unsetenv("SOURCE_DATE_EPOCH");
  EXPECT_TRUE(page.starts_with(".TH \"LIMN\" 1 \"2026\\-11\\-27\" \"limn ")) << page.substr(0, 60);
}

TEST(Table, EveryOptionIsInTheManualPageOfItsCommand) {
  std::size_t options = 0;
  for (const auto& [name, found] : table()) {
    std::vector<std::string> words = {"help", "--format", "man"};
    std::istringstream names(name);
    for (std::string word; names >> word;) words.push_back(word);
    const std::string page = test::run_limn(words).out;
    for (const char* part :
         {"NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "FILES", "EXIT STATUS", "SEE ALSO"})
      EXPECT_NE(page.find(std::string(".SH ") + part + "\n"), std::string::npos) << name << part;
    for (std::string option : found.options) {
      option = std::regex_replace(option, std::regex("-"), "\\-");
      EXPECT_NE(page.find("\\fB" + option + "\\fR"), std::string::npos) << name << " " << option;
      ++options;
    }
  }
  EXPECT_GT(options, 200u);
}

// The part of a text from one line that begins so to the next one that `end` matches.
std::string part_of(const std::string& text, const std::string& begin, const std::string& end) {
  const auto at = text.find(begin);
  return at == std::string::npos ? "" : text.substr(at, text.find(end, at + begin.size()) - at);
}

TEST(Table, EveryOptionIsInTheCompletionsOfAllShells) {
  const std::string bash = document("bash"), zsh = document("zsh"), fish = document("fish");
  for (const auto& [name, found] : table()) {
    const std::string in_bash = part_of(bash, "    '" + name + "')\n", "      ;;\n");
    std::string function = name.empty() ? "limn" : "limn " + name;
    std::replace(function.begin(), function.end(), ' ', '_');
    const std::string in_zsh = part_of(zsh, "_" + function + "_options() {", "\n}\n");
    const std::string at = name.empty() ? "'test (count (commandline -opc)) -eq 1" : "'__limn_at " + name;
    for (const std::string& option : found.options) {
      EXPECT_NE(in_bash.find(" " + option + " "), std::string::npos) << "bash: " << name << " " << option;
      EXPECT_NE(in_zsh.find(option + "["), std::string::npos) << "zsh: " << name << " " << option;
      const std::regex line("complete -c limn -n " + std::regex_replace(at, std::regex("[()]"), "\\$&") +
                            "(;[^']*)?'[^\n]* -l " + option.substr(2) + " ");
      EXPECT_TRUE(std::regex_search(fish, line)) << "fish: " << name << " " << option;
    }
  }
}

TEST(Table, ThePageOfCommandsIsUpToDate) {
  const auto page = read_file(fs::path(LIMN_SOURCE_DIR) / "docs/commands.md");
  ASSERT_TRUE(page) << page.message();
  EXPECT_TRUE(page.value() == document("markdown"))
      << "docs/commands.md is not what the table of commands says. Write it again: ./limn help --format "
         "markdown --out docs";
}

TEST(Table, ManualPagesHaveNoWarnings) {
  if (!has_program("man")) GTEST_SKIP() << "man is not installed";
  const fs::path folder = test::test_folder();
  ASSERT_EQ(test::run_limn({"help", "--format", "man", "--out", folder.string()}).code, 0);
  EXPECT_EQ(output_of("cd " + folder.string() +
                      " && for page in *.1; do LC_ALL=C.UTF-8 man --warnings -l $page 2>&1 >/dev/null; done"),
            "");
}

class Completion : public testing::Test {
 protected:
  void SetUp() override {
    write("a.json", "");
    write("b.png", "");
    write("world.json", R"({"scene": "scene"})");
    write("scene/scene.json", R"({"slots": [{"name": "mirror", "variants": [{"name": "sport"}]}]})");
    write("config/limn/rooms/studio/room.json", "");
    for (const char* shell : {"bash", "zsh", "fish"})
      ASSERT_EQ(test::run_limn({"help", "--format", shell, "--out", folder_.string()}).code, 0);
  }
  void write(const std::string& name, const std::string& content) {
    fs::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(write_file(folder_ / name, content));
  }
  std::string output(const std::string& shell_command) const {
    return output_of(
        fmt::format("cd {0} && export XDG_CONFIG_HOME={0}/config && {1}", folder_.string(), shell_command));
  }
  // The candidates of bash for the end of this line, each followed by a space.
  std::string bash(const std::string& line) const {
    write_script("line.sh",
                 fmt::format("set +o posix\n. ./limn\nCOMP_LINE='{} {}'\nCOMP_POINT=${{#COMP_LINE}}\n"
                             "_limn\nprintf '%s\\n' \"${{COMPREPLY[@]}}\" | LC_ALL=C sort | tr '\\n' ' '\n",
                             LIMN_PROGRAM, line));
    return output("bash line.sh");
  }
  void write_script(const std::string& name, const std::string& text) const {
    ASSERT_TRUE(write_file(folder_ / name, text));
  }
  fs::path folder_ = test::test_folder();
};

TEST_F(Completion, OfBashGivesCommandsOptionsAndValues) {
  EXPECT_EQ(bash("de"), "demo detect deviation ");
  EXPECT_EQ(bash("room c"), "create ");
  EXPECT_EQ(bash("room create --o"), "--out ");
  EXPECT_EQ(bash("live --serve"), "--serve --serve-show ");
  EXPECT_EQ(bash("patterns --code "), "gray phase xor ");
  EXPECT_EQ(bash("patterns --code=p"), "phase ");
  EXPECT_EQ(bash("capture --plan "), "a.json config scene world.json ")
      << "files with the extension, folders";
  EXPECT_EQ(bash("detect b"), "b.png ");
  EXPECT_EQ(bash("detect --draw s"), "scene ");
}

TEST_F(Completion, OfBashGivesWhatTheProgramKnows) {
  EXPECT_EQ(bash("markers --family apriltag_36"), "apriltag_36h10 apriltag_36h11 ");
  EXPECT_EQ(bash("node --join "), "studio ");
  EXPECT_EQ(bash("simulate world.json --variants m"), "mirror=sport ");
  EXPECT_EQ(bash("simulate world.json --variants mirror="), "sport ");
  EXPECT_EQ(bash("bench tra"), "tracker ");
}

TEST_F(Completion, OfBashGivesLaterValuesOfAList) {
  EXPECT_EQ(bash("detect b.png --family apriltag_16h5,apriltag_36"),
            "apriltag_16h5,apriltag_36h10 apriltag_16h5,apriltag_36h11 ");
  EXPECT_EQ(bash("detect b.png --family apriltag_16h5 apriltag_36"), "apriltag_36h10 apriltag_36h11 ");
  EXPECT_EQ(bash("render --viewer a.json w"), "world.json ");
  EXPECT_EQ(bash("render --viewer a.json --out s"), "scene ") << "another option came between";
  EXPECT_EQ(bash("render --viewer a.json --composi"), "--composite ");
}

TEST_F(Completion, OfFishGivesCommandsOptionsAndValues) {
  if (!has_program("fish")) GTEST_SKIP() << "fish is not installed";
  const auto fish = [&](const std::string& line) {
    return output(fmt::format("fish --no-config -c 'source limn.fish; complete -C \"{}\"' 2>&1", line));
  };
  EXPECT_NE(fish("limn live --serve").find("--serve-show\t"), std::string::npos) << fish("limn live --serve");
  EXPECT_NE(fish("limn de").find("detect\t"), std::string::npos);
  EXPECT_NE(fish("limn patterns --code ").find("phase"), std::string::npos);
  EXPECT_NE(fish("limn import rig --un").find("--units"), std::string::npos);
  EXPECT_EQ(fish("limn import --un"), "");
}

TEST_F(Completion, IsWellFormedForEveryShell) {
  EXPECT_EQ(output("bash -n limn 2>&1"), "");
  if (has_program("zsh")) {
    EXPECT_EQ(output("zsh -n _limn 2>&1"), "");
  }
  if (has_program("fish")) {
    EXPECT_EQ(output("fish -n limn.fish 2>&1"), "");
  }
}

}  // namespace
}  // namespace limn::apps
