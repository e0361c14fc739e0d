// What debian/ says agrees with what the build says.

#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <string>

#include "core/file.h"
#include "core/version.h"

namespace limn {
namespace {

std::string source(const std::string& name) { return read_file(LIMN_SOURCE_DIR "/" + name).value(); }

TEST(Packages, HaveTheVersionOfTheBuild) {
  const std::string begin = "limn (" + std::string(version()) + ") ";
  EXPECT_TRUE(source("debian/changelog").starts_with(begin)) << "expected in the first line: " << begin;
}

// Whoever can build with ./limn can build the packages, and the other way round.
TEST(Packages, NeedWhatIsListedForABuild) {
  std::set<std::string> listed;
  for (const char* list : {"packages.txt", "tools/package_tools.txt"}) {
    std::ifstream lines(std::string(LIMN_SOURCE_DIR "/") + list);
    for (std::string line; std::getline(lines, line);) listed.insert(line);
  }
  static const std::regex field(R"(Build-Depends:((?:[^\n]|\n )*))"), name(R"([a-z][a-z0-9.+-]+)");
  const std::string control = source("debian/control");
  std::smatch needed;
  ASSERT_TRUE(std::regex_search(control, needed, field));
  const std::string text = std::regex_replace(needed[1].str(), std::regex(R"(\([^)]*\)|:any)"), "");
  int count = 0;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), name); at != std::sregex_iterator(); ++at) {
    const std::string package = at->str() == "debhelper-compat" ? "debhelper" : at->str();
    EXPECT_TRUE(listed.contains(package)) << package << " is in debian/control, but in no list of packages";
    ++count;
  }
  EXPECT_GT(count, 30);
}

}  // namespace
}  // namespace limn
