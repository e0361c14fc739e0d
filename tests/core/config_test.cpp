#include "core/config.h"

#include <gtest/gtest.h>

#include <array>
#include <functional>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

class ConfigFile : public testing::Test {
 protected:
  Result<Config> load(const std::string& text, const std::string& schema = "limn.test/1") {
    EXPECT_TRUE(write_file(path_, text));
    return Config::load(path_, schema);
  }
  // The message of the first problem that `read` causes.
  template <class Read>
  std::string message(const std::string& text, Read read) {
    const auto config = load(text);
    if (!config) return config.message();
    read(config->root());
    return config->status() ? "" : config->status().message();
  }
  std::filesystem::path path_ = test::test_folder() / "file.json";
};

#define EXPECT_SAYS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

TEST_F(ConfigFile, ReadsValuesAndComments) {
  const auto config = load(R"({"schema": "limn.test/1", // what it is
    "size": [3, 4], "lens": {"fx": 2.5}})");
  ASSERT_TRUE(config) << config.message();
  EXPECT_EQ(config->root().at("lens").at("fx").positive(), 2.5);
  EXPECT_EQ(config->root().at("size").numbers(2), (std::vector<double>{3, 4}));
  EXPECT_FALSE(config->root().find("absent"));
  EXPECT_TRUE(config->status());
}

TEST_F(ConfigFile, AProblemKnowsItsPath) {
  const std::string text = R"({"schema": "limn.test/1", "projectors": [{"lens": {"fx": -1}}]})";
  const auto read = [](const ConfigNode& root) {
    root.at("projectors").items()[0].at("lens").at("fx").positive();
  };
  EXPECT_SAYS(message(text, read), "file.json: projectors[0].lens.fx: expected a number > 0, found -1.");
}

TEST_F(ConfigFile, AKeyThatStandsTwiceIsAProblem) {
  const auto nothing = [](const ConfigNode&) {};
  EXPECT_SAYS(message(R"({"schema": "limn.test/1", "a": {"b": 1, "c": 2, "b": 3}})", nothing),
              "file.json: expected each key once, found \"b\" twice in one object.");
  EXPECT_EQ(message(R"({"schema": "limn.test/1", "a": {"b": 1}, "c": [{"b": 1}, {"b": 2}]})", nothing), "");
}

TEST_F(ConfigFile, ANestingTooDeepIsAProblem) {
  const std::string text = R"({"schema": "limn.test/1", "a": )";
  for (const int levels : {200, 1000000}) {
    const std::string nested = std::string(static_cast<std::size_t>(levels), '[') +
                               std::string(static_cast<std::size_t>(levels), ']');
    EXPECT_SAYS(message(text + nested + "}", [](const ConfigNode& root) { root.at("a").number(); }),
                "expected at most 100 levels");
  }
}

TEST_F(ConfigFile, TheFirstProblemIsKept) {
  const std::string text = R"({"schema": "limn.test/1", "a": "x", "b": "y"})";
  EXPECT_SAYS(message(text,
                      [](const ConfigNode& root) {
                        root.at("a").number();
                        root.at("b").number();
                      }),
              "a: expected a finite number, found string \"x\"");
}

TEST_F(ConfigFile, NumbersBeyondReasonAreRefusedAtTheirKey) {
  const auto with = [&](const std::string& value, const std::function<void(const ConfigNode&)>& read) {
    return message(fmt::format(R"({{"schema": "limn.test/1", "a": {{"b": {}}}}})", value),
                   [&](const ConfigNode& root) { read(root.at("a").at("b")); });
  };
  EXPECT_SAYS(with("-1e308", [](const ConfigNode& b) { b.number(); }),
              "a.b: expected a number from -1000000000");
  EXPECT_SAYS(with("99999999999999999999", [](const ConfigNode& b) { b.integer(); }),
              "a.b: expected a whole");
  EXPECT_SAYS(with("12", [](const ConfigNode& b) { b.positive(11); }), "a.b: expected at most 11, found 12");
  EXPECT_SAYS(with("[0, 1e6, 0]", [](const ConfigNode& b) { b.vector3(); }), "a.b: expected three numbers");
  EXPECT_SAYS(with(R"({"rotation_wxyz": [1, 0, 0, 0], "translation_m": [1e308, 0, 0]})",
                   [](const ConfigNode& b) { b.pose(); }),
              "a.b.translation_m[0]: expected a number");
  for (const char* size : {"[99999999999999999999, 2]", "[2, 16385]", "[2.5, 2]", "[0, 2]", "[2]", "7"})
    EXPECT_SAYS(with(size, [](const ConfigNode& b) { b.image_size(); }), "a.b");
  EXPECT_EQ(with("[16384, 1]",
                 [](const ConfigNode& b) {
                   EXPECT_EQ(b.image_size(), (std::array{16384, 1}));
                 }),
            "");
}

TEST_F(ConfigFile, UnknownAndMissingKeysAreErrors) {
  EXPECT_SAYS(message(R"({"schema": "limn.test/1", "unit": "mm"})",
                      [](const ConfigNode& root) {
                        root.only({"schema", "units"});
                      }),
              "unknown key \"unit\"; did you mean \"units\"?");
  EXPECT_SAYS(
      message(R"({"schema": "limn.test/1"})", [](const ConfigNode& root) { root.at("units").text(); }),
      "units: this key is missing");
}

TEST_F(ConfigFile, SyntaxErrorsSayTheLine) {
  EXPECT_SAYS(message("{\"schema\": \"limn.test/1\",\n \"a\": ", [](const ConfigNode&) {}), "file.json:2");
}

TEST_F(ConfigFile, AnotherSchemaIsAnError) {
  EXPECT_SAYS(message(R"({"schema": "limn.rig/1"})", [](const ConfigNode&) {}), "expected \"limn.test/1\"");
}

TEST_F(ConfigFile, PosesMustBeUnitQuaternions) {
  const auto read = [](const ConfigNode& root) { root.at("p").pose(); };
  EXPECT_SAYS(
      message(R"({"schema": "limn.test/1", "p": {"rotation_wxyz": [2, 0, 0, 0], "translation_m": [0,0,0]}})",
              read),
      "p.rotation_wxyz: expected a unit quaternion");
  EXPECT_SAYS(
      message(R"({"schema": "limn.test/1", "p": {"rotation_wxyz": [1, 0, 0], "translation_m": [0,0,0]}})",
              read),
      "expected 4 numbers");
}

TEST_F(ConfigFile, PathsMustStayInsideTheFolder) {
  for (const char* path : {"/etc/passwd", "../x.glb", "a/../../x.glb", ""}) {
    const std::string text = fmt::format(R"({{"schema": "limn.test/1", "mesh": "{}"}})", path);
    EXPECT_SAYS(message(text, [](const ConfigNode& root) { root.at("mesh").path_inside(); }),
                "relative path inside");
  }
}

TEST_F(ConfigFile, WrongTypesNeverThrow) {
  for (const char* value : {"null", "3", "\"x\"", "[]", "{}", "true", "1e999"}) {
    const auto config = load(fmt::format(R"({{"schema": "limn.test/1", "v": {}}})", value));
    if (!config) continue;  // 1e999 is no JSON number
    const ConfigNode v = config->root().at("v");
    v.number(), v.integer(), v.boolean(), v.text(), v.numbers(3), v.vector3(), v.pose(), v.path_inside(),
        v.items();
    v.at("x").at("y").number();
    EXPECT_FALSE(config->status()) << value;
  }
}

}  // namespace
}  // namespace limn
