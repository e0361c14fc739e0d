// What debian/ says agrees with what the build says.

#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/version.h"

namespace limn {
namespace {

std::string source(const std::string& name) { return read_file(LIMN_SOURCE_DIR "/" + name).value(); }

TEST(Packages, HaveTheVersionOfTheBuild) {
  const std::string begin = "limn (" + std::string(version()) + ") ";
  EXPECT_TRUE(source("debian/changelog").starts_with(begin)) << "expected in the first line: " << begin;
}

// The names in lists of packages, whatever their release.
std::set<std::string> listed_in(const std::vector<std::string>& lists) {
  std::set<std::string> names;
  for (const std::string& list : lists) {
    std::istringstream lines(source(list));
    for (std::string line; std::getline(lines, line);) {
      const std::string name = line.substr(0, line.find_first_of(" #"));
      if (!name.empty()) names.insert(name);
    }
  }
  return names;
}

// The names in all fields of debian/control with this name, for example Depends; alternatives are names, too.
std::set<std::string> control_names(const std::string& field) {
  static const std::regex other(R"(\([^)]*\)|\[[^\]]*\]|<[^>]*>|:any|\$\{[^}]*\})"),
      name(R"([a-z][a-z0-9.+-]+)");
  const std::regex fields("\n" + field + R"(:((?:[^\n]|\n )*))");
  const std::string control = source("debian/control");
  std::set<std::string> names;
  for (auto at = std::sregex_iterator(control.begin(), control.end(), fields); at != std::sregex_iterator();
       ++at) {
    const std::string text = std::regex_replace((*at)[1].str(), other, "");
    for (auto to = std::sregex_iterator(text.begin(), text.end(), name); to != std::sregex_iterator(); ++to) {
      names.insert(to->str() == "debhelper-compat" ? "debhelper" : to->str());
    }
  }
  return names;
}

// Whoever can build with ./limn can build the packages, and the other way round.
TEST(Packages, NeedWhatIsListedForABuild) {
  const auto needed = control_names("Build-Depends");
  const auto listed = listed_in({"packages.txt", "tools/package_tools.txt"});
  EXPECT_GT(needed.size(), 30u);
  for (const std::string& name : needed) {
    EXPECT_TRUE(listed.contains(name)) << name << " is in debian/control, but in no list of packages";
  }
  // In the lists for other reasons: part of every build of Debian, a faster build, the tests.
  std::set<std::string> known = {"build-essential", "ccache", "libgtest-dev"};
  known.merge(control_names("Build-Depends"));
  for (const char* field : {"Depends", "Recommends"}) known.merge(control_names(field));
  for (const std::string& name : listed_in({"packages.txt"})) {
    EXPECT_TRUE(known.contains(name))
        << name << " is in packages.txt, but debian/control does not need it. If only "
        << "the tests need it, it belongs in tests/packages.txt";
  }
}

}  // namespace
}  // namespace limn
