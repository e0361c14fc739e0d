#include "tracker/family.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
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

TEST(Families, TellWhichMarkersOfADictionaryLookTheSame) {
  const auto file = test::test_folder() / "alike.yml";
  const auto message = [&](const std::string& a, const std::string& b) {
    EXPECT_TRUE(write_file(
        file, "%YAML:1.0\nnmarkers: 2\nmarkersize: 3\nmarker_0: \"" + a + "\"\nmarker_1: \"" + b + "\"\n"));
    return load_message("aruco:" + file.string());
  };
  EXPECT_NE(message("110100000", "110100000").find("marker_0 and marker_1 look the same"), std::string::npos);
  EXPECT_NE(message("110100000", "011001000").find("marker_0 and marker_1 turned by 270 degrees"),
            std::string::npos);
  EXPECT_NE(message("110100000", "101111101").find("marker_1 looks the same turned by 180 degrees"),
            std::string::npos);
  EXPECT_NE(message("010111010", "110100000").find("marker_0 looks the same turned by 90 degrees"),
            std::string::npos);
  EXPECT_EQ(message("110100000", "110100001"), "loaded");  // with a warning: one wrong cell exchanges them
}

TEST(Families, CorrectNoErrorsWhereOneMakesAnotherMarker) {
  const auto file = test::test_folder() / "near.yml";
  const std::string code(35, '0');
  ASSERT_TRUE(write_file(file, "%YAML:1.0\nnmarkers: 2\nmarkersize: 6\nmarker_0: \"1" + code +
                                   "\"\nmarker_1: \"11" + code.substr(1) + "\"\n"));
  const auto loaded = Families::load(std::vector{"aruco:" + file.string()});
  ASSERT_TRUE(loaded) << loaded.message();
  EXPECT_EQ(loaded->codes()[0].max_errors[0], 0);
}

TEST(Families, RefuseATemplateThatEndsAfterWholeRows) {
  const auto file = test::test_folder() / "short.patt";
  std::string text = template_text(16);  // 192 lines of 16 numbers
  std::size_t end = 0;
  for (int line = 0; line < 147; ++line) end = text.find('\n', end) + 1;  // 2352 numbers, as 14 x 14 x 12
  ASSERT_TRUE(write_file(file, text.substr(0, end)));
  const std::string message = load_message("artoolkit:" + file.string());
  EXPECT_NE(message.find("line 147: expected 3072 numbers"), std::string::npos) << message;
  EXPECT_NE(message.find("found 2352"), std::string::npos) << message;
}

TEST(Families, TakeAPatternRatioAfterTheFilesName) {
  const auto file = test::test_folder() / "wide@home.patt";
  ASSERT_TRUE(write_file(file, template_text(16)));
  const auto loaded = Families::load(std::vector{"artoolkit:" + file.string() + "@0.8"});
  ASSERT_TRUE(loaded) << loaded.message();
  EXPECT_EQ(loaded->templates()[0].id, "wide@home.patt@0.8");
  EXPECT_NEAR(loaded->templates()[0].border, 0.1, 1e-12);
  EXPECT_EQ(load_message("artoolkit:" + file.string()), "loaded");
  for (const char* ratio : {"@1", "@0.1", "@.", "@0.8.1"})
    EXPECT_NE(load_message("artoolkit:" + file.string() + ratio).find("expected the pattern's share"),
              std::string::npos)
        << ratio;
}

TEST(Families, NameInvertedMarkersByAWord) {
  const auto families =
      Families::load(std::vector<std::string>{"aruco_4x4_50_inverted", "aruco_4x4_50", "apriltag_41h12"});
  ASSERT_TRUE(families) << families.message();
  EXPECT_EQ(families->codes()[0].name, "aruco_4x4_50_inverted");
  EXPECT_TRUE(families->codes()[0].light_on_dark);
  EXPECT_EQ(families->codes()[0].codes, families->codes()[1].codes);
  EXPECT_TRUE(families->codes()[2].light_on_dark);
  EXPECT_NE(load_message("_inverted").find("expected one of"), std::string::npos);
}

TEST(Families, DrawInvertedMarkersInADarkRing) {
  const cv::Mat dark = draw_marker({"aruco_4x4_50", "7"}, 3).value();
  const MarkerDrawing light = draw_whole_marker({"aruco_4x4_50_inverted", "7"}, 3).value();
  EXPECT_EQ(light.around_px, 3);
  const cv::Mat square = draw_marker({"aruco_4x4_50_inverted", "7"}, 3).value();
  EXPECT_EQ(cv::countNonZero(square == dark), 0);
  EXPECT_EQ(cv::countNonZero(light.image), cv::countNonZero(square));
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
