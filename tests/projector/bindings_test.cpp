// Binding slots of textures, images and buffers: C++ and GLSL use the same constants, defined once.
#include "projector/bindings.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "projector/defines.h"

namespace limn::projector {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

// File name -> text, without bindings.glsl.
std::map<std::string, std::string> sources(const std::string& folder, const std::set<std::string>& endings) {
  std::map<std::string, std::string> found;
  for (const auto& entry : fs::directory_iterator(fs::path(LIMN_SOURCE_DIR) / folder))
    if (endings.contains(entry.path().extension().string()) && entry.path().filename() != "bindings.glsl")
      found[entry.path().filename().string()] = text_of(entry.path());
  return found;
}

std::map<std::string, std::string> shaders() {
  return sources("shaders", {".glsl", ".comp", ".frag", ".vert"});
}
std::map<std::string, std::string> cpp_files() { return sources("projector", {".h", ".cpp"}); }

std::vector<std::smatch> matches(const std::string& text, const std::regex& pattern) {
  return {std::sregex_iterator(text.begin(), text.end(), pattern), std::sregex_iterator()};
}

// The constants of bindings.glsl: name -> number.
std::map<std::string, int> bindings() {
  static const std::regex pattern(R"(const int (k_\w+) = (\d+);)");
  static const std::string text = text_of(fs::path(LIMN_SOURCE_DIR) / "shaders/bindings.glsl");
  std::map<std::string, int> found;
  for (const std::smatch& match : matches(text, pattern)) found[match[1]] = std::stoi(match[2]);
  return found;
}

std::string kind_of(const std::string& name) { return name.substr(name.rfind('_') + 1); }

// Matches every declaration in a shader that is bound to a slot.
const std::regex& bound() {
  static const std::regex pattern(
      R"((?:layout\(([^)]*)\) )?(?:uniform (?:readonly |writeonly )?[iu]?(sampler|image)\w+ \w+;|(?:readonly )?(buffer) \w+ \{))");
  return pattern;
}

TEST(Bindings, ShadersNameEachPlaceByItsKind) {
  static const std::regex named(R"(binding = (k_\w+))");
  const std::map<std::string, std::string> kinds = {
      {"sampler", "unit"}, {"image", "image"}, {"buffer", "buffer"}};
  int seen = 0;
  for (const auto& [file, text] : shaders()) {
    for (const std::smatch& match : matches(text, bound())) {
      ++seen;
      const std::string layout = match[1], kind = match[2].matched ? match[2] : match[3];
      std::smatch name;
      ASSERT_TRUE(std::regex_search(layout, name, named))
          << file << ": " << match[0] << ": expected a slot named in bindings.glsl";
      EXPECT_TRUE(bindings().contains(name[1])) << file << ": " << name[1] << " is not in bindings.glsl";
      EXPECT_EQ(kind_of(name[1]), kinds.at(kind)) << file << ": " << match[0];
    }
    EXPECT_FALSE(std::regex_search(text, std::regex(R"(binding = \d)")))
        << file << ": expected a slot named in bindings.glsl, found a bare number";
  }
  EXPECT_GT(seen, 40) << "the shaders were not found";
}

TEST(Bindings, AreUsedByShadersAndByTheProgramAlike) {
  std::string in_shaders, in_program;
  for (const auto& [file, text] : shaders()) in_shaders += text;
  for (const auto& [file, text] : cpp_files()) in_program += text;
  for (const auto& [name, number] : bindings()) {
    const std::regex word("\\b" + name + "\\b");
    EXPECT_TRUE(std::regex_search(in_shaders, word)) << name << ": no shader uses it";
    EXPECT_TRUE(std::regex_search(in_program, word)) << name << ": nothing in projector/ uses it";
  }
  EXPECT_GT(bindings().size(), 20u) << "bindings.glsl was not found";
  EXPECT_EQ(bindings().at("k_brdf_lut_unit"), k_brdf_lut_unit);  // both languages read the same file
}

TEST(Bindings, HaveAPlaceEachWithinWhatGlPromises) {
  const std::map<std::string, int> promised = {{"unit", 96}, {"image", 8}, {"buffer", 8}};
  std::map<std::pair<std::string, int>, std::string> taken;
  for (const auto& [name, number] : bindings()) {
    EXPECT_LT(number, promised.at(kind_of(name))) << name;
    const auto [other, is_new] = taken.emplace(std::pair(kind_of(name), number), name);
    EXPECT_TRUE(is_new) << name << " has the same number as " << other->second;
  }
}

TEST(Bindings, HaveNoBareNumberInCalls) {
  static const std::regex call(
      R"((?:glBindTextureUnit|glBindImageTexture|glBindBufferBase|glBindBufferRange)\(\s*(?:GL_\w+,\s*)?(\S))");
  int seen = 0;
  for (const auto& [file, text] : cpp_files()) {
    for (const std::smatch& match : matches(text, call)) {
      ++seen;
      EXPECT_FALSE(std::isdigit(static_cast<unsigned char>(*match[1].first))) << file << ": " << match[0];
    }
    EXPECT_FALSE(std::regex_search(text, std::regex(R"((?:TextureAt|ImageAt)[ \w]*\(\d)"))) << file;
  }
  EXPECT_GT(seen, 8) << "the calls were not found";
}

TEST(Defines, AreThoseThatShadersAskFor) {
  static const std::regex asked(R"(#\s*ifn?def (\w+))");
  std::set<std::string> in_shaders;
  for (const auto& [file, text] : shaders())
    for (const std::smatch& match : matches(text, asked)) in_shaders.insert(match[1]);
  EXPECT_EQ(in_shaders, std::set<std::string>(k_define_names.begin(), k_define_names.end()));
}

TEST(Defines, AddUp) {
  constexpr Defines both = Defines{Define::work_list} + Defines{Define::view_parts};
  EXPECT_TRUE(both.contains(Define::work_list) && both.contains(Define::view_parts));
  EXPECT_FALSE(both.contains(Define::surface_maps) || both.contains(Define::by_measurement));
}

}  // namespace
}  // namespace limn::projector
