#include "tracker/family.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/file.h"
#include "tests/tracker/template_text.h"
#include "tests/tracker/vga_markers.h"

namespace limn::tracker {
namespace {

std::string load_message(const std::string& name) {
  const auto loaded = Families::load(std::vector<std::string>{name});
  return loaded ? "loaded" : loaded.message();
}

TEST(Families, SaysWhatIsWrongWithAName) {
  EXPECT_NE(load_message("aruco_9x9_50").find("aruco_4x4_50"), std::string::npos);
  EXPECT_NE(load_message("aruco:").find("expected one of"), std::string::npos);
  EXPECT_NE(load_message("artoolkit:absent.patt").find("absent.patt"), std::string::npos);
}

TEST(Families, SaysWhatIsWrongWithATemplateFile) {
  const auto file = test::test_folder() / "broken.patt";
  const std::string good = template_text(16);
  ASSERT_TRUE(write_file(file, good.substr(0, good.size() / 2)));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("cut short"), std::string::npos);
  ASSERT_TRUE(write_file(file, "not a pattern"));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("expected numbers"), std::string::npos);
  ASSERT_TRUE(write_file(file, ""));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("found 0"), std::string::npos);
  ASSERT_TRUE(write_file(file, good.substr(0, good.rfind("235"))));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("found 3071"), std::string::npos);
}

TEST(Families, SaysWhatIsWrongWithADictionaryFile) {
  const auto file = test::test_folder() / "broken.yml";
  const auto message = [&](const std::string& text) {
    EXPECT_TRUE(write_file(file, text));
    return load_message("aruco:" + file.string());
  };
  EXPECT_NE(message("%YAML:1.0\nnmarkers: 2\nmarkersize: 3\nmarker_0: \"010101010\"\n").find("marker_1"),
            std::string::npos);
  EXPECT_NE(message("%YAML:1.0\nnmarkers: 1\nmarkersize: 3\nmarker_0: \"01\"\n").find("9 characters"),
            std::string::npos);
  EXPECT_NE(message("%YAML:1.0\nnmarkers: 1\nmarkersize: 30\nmarker_0: \"01\"\n").find("markersize"),
            std::string::npos);
  EXPECT_NE(message("%YAML:1.0\nnmarkers: [").find("broken.yml"), std::string::npos);
  EXPECT_NE(message("").find("broken.yml"), std::string::npos);
  EXPECT_EQ(message("%YAML:1.0\nnmarkers: 1\nmarkersize: 3\nmarker_0: \"010110100\"\n"), "loaded");
}

TEST(Families, DrawsOnlyIdsThatExist) {
  EXPECT_TRUE(draw_marker({"aruco_4x4_50", "49"}, 4));
  EXPECT_NE(draw_marker({"aruco_4x4_50", "50"}, 4).message().find("0 to 49"), std::string::npos);
  EXPECT_FALSE(draw_marker({"aruco_4x4_50", "-1"}, 4));
  EXPECT_FALSE(draw_marker({"aruco_4x4_50", "3x"}, 4));
}

TEST(Families, AreNamedOnceForTheMarkersOfBodies) {
  const std::vector<Body> bodies = {
      {"prototype", {{{"aruco_4x4_50", "1"}, 0.04, {}}, {{"aruco_4x4_50", "2"}, 0.04, {}}}},
      {"slot", {{{"artoolkit", "hiro.patt"}, 0.08, {}}}}};
  EXPECT_EQ(families_of(bodies), (std::vector<std::string>{"aruco_4x4_50", "artoolkit:hiro.patt"}));
}

}  // namespace
}  // namespace limn::tracker
