// Tests that the documents are right: their commands and options exist, and the quoted output is the real
// output.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <regex>
#include <sstream>

#include "core/file.h"
#include "tests/support/run_limn.h"
#include "wizard/design/rig_description.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;

const fs::path k_source = LIMN_SOURCE_DIR;
constexpr const char* k_pages[] = {
    "README.md",         "CONTRIBUTING.md",      "config/README.md", "docs/architecture.md",
    "docs/formats.md",   "docs/measurements.md", "docs/osc.md",      "docs/remote.md",
    "docs/setting-up.md"};

struct Quoted {
  std::string where, command;
  std::vector<std::string> options;
};

// Finds "limn COMMAND …" in code lines and between back ticks; a code line ends at "#".
std::vector<Quoted> quoted_commands(const fs::path& page) {
  static const std::regex code(R"((?:^    |`)(?:\./)?limn ([a-z]+)((?: [^`#]*)?))"),
      option(R"((?:^|[\s(])(--[a-z-]+))");
  std::vector<Quoted> all;
  std::istringstream lines(read_file(k_source / page).value());
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    for (std::sregex_iterator at(line.begin(), line.end(), code), end; at != end; ++at) {
      Quoted quoted{fmt::format("{}:{}", page.string(), number), (*at)[1], {}};
      const std::string rest = (*at)[2];
      for (std::sregex_iterator o(rest.begin(), rest.end(), option); o != end; ++o)
        quoted.options.push_back((*o)[1]);
      all.push_back(std::move(quoted));
    }
  }
  return all;
}

TEST(Documents, EveryCommandAndOptionExists) {
  std::map<std::string, std::string> helps;
  std::size_t options = 0;
  for (const char* page : k_pages) {
    for (const Quoted& quoted : quoted_commands(page)) {
      auto help = helps.find(quoted.command);
      if (help == helps.end()) {
        const test::Outcome outcome = test::run_limn({quoted.command, "--help"});
        help = helps.emplace(quoted.command, outcome.out).first;
        if (quoted.command == "import")
          for (const char* kind : {"rig", "cad", "lines"})
            help->second += test::run_limn({"import", kind, "--help"}).out;
        if (quoted.command == "export") help->second += test::run_limn({"export", "lines", "--help"}).out;
        EXPECT_EQ(outcome.code, 0) << quoted.where << ": limn " << quoted.command;
      }
      if (quoted.command == "bench") continue;  // its options belong to the benches
      for (const std::string& option : quoted.options) {
        ++options;
        EXPECT_TRUE(std::regex_search(help->second,
                                      std::regex("^ +(-., *)?" + option + "\\b", std::regex::multiline)))
            << quoted.where << ": limn " << quoted.command << " has no " << option;
      }
    }
  }
  EXPECT_GT(helps.size(), 15u);
  EXPECT_GT(options, 60u);
}

// The blocks of docs/setting-up.md that follow "limn plan FILE".
TEST(Documents, QuoteWhatLimnPlanPrints) {
  const std::string page = read_file(k_source / "docs/setting-up.md").value();
  for (const char* file : {"config/described/first.json", "config/described/large.json"}) {
    EXPECT_NE(page.find(fmt::format("./limn plan {}", file)), std::string::npos);
    const test::Outcome outcome = test::run_limn({"plan", (k_source / file).string()});
    std::istringstream lines(outcome.out);
    EXPECT_EQ(outcome.code, 0) << file << ": " << outcome.err;
    int count = 0;
    for (std::string line; std::getline(lines, line); ++count)
      EXPECT_NE(page.find("    " + line + "\n"), std::string::npos)
          << file << " prints, and the page lacks:\n"
          << line;
    EXPECT_GE(count, 6) << file;
  }
}

TEST(Documents, NameFilesThatAreThere) {
  static const std::regex path(R"((config/[a-z/-]+\.(?:json|glb)|docs/[a-z-]+\.md))");
  for (const char* page : k_pages) {
    const std::string text = read_file(k_source / page).value();
    for (std::sregex_iterator at(text.begin(), text.end(), path), end; at != end; ++at)
      EXPECT_TRUE(fs::exists(k_source / at->str())) << page << ": " << at->str();
  }
}

}  // namespace
}  // namespace limn::apps
