#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/matchers.h"
#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"
#include "tracker/template_comparison.h"
#include "tracker/template_training.h"

namespace limn::tracker {
namespace {

std::string detected_text(const std::filesystem::path& file) { return "artoolkit:" + file.string(); }

// A template file of three bars and a corner, which differs from its own rotations.
std::filesystem::path bars(const std::filesystem::path& folder, const std::string& name, int wide) {
  std::string text;
  for (int block = 0; block < 12; ++block)
    for (int row = 0; row < 16; ++row)
      for (int column = 0; column < 16; ++column)
        text += column < wide || (row < 5 && column > 10) || (row > 11 && column < 9) ? " 20" : " 240";
  const auto path = folder / name;
  EXPECT_TRUE(write_file(path, text));
  return path;
}

cv::Mat image_with(const std::vector<PlacedMarker>& markers, std::mt19937_64& rng) {
  return test::image_of(pinhole_vga(), test::plain(640, 480, 110), markers,
                        {.blur_px = 0.7, .noise_levels = 2}, rng);
}

PlacedMarker placed(const std::filesystem::path& file, double x, double side_px, double spin, double tilt) {
  return test::placed(pinhole_vga(), {"artoolkit", file.string()}, {x, 240}, side_px, spin, tilt, 0.7);
}

TEST(Templates, TrainedFromAnImageAreFoundAgain) {
  auto rng = test::test_rng();
  const auto folder = test::test_folder();
  const auto original = bars(folder, "bars.patt", 4);
  const auto trained = train_template(image_with({placed(original, 300, 160, 0.3, 30_deg)}, rng));
  ASSERT_TRUE(trained) << trained.message();
  const auto learned = folder / "learned.patt";
  ASSERT_TRUE(write_file(learned, template_text(*trained)));
  Detector detector(Families::load(std::vector{detected_text(learned)}).value());
  for (int turn = 0; turn < 4; ++turn) {
    const PlacedMarker marker = placed(original, 330, 110, 0.2 + turn * 90_deg, 35_deg);
    const auto found = detector.detect(image_with({marker}, rng));
    ASSERT_EQ(found.size(), 1u) << turn;
    EXPECT_EQ(found[0].marker.text(), "artoolkit:learned.patt");
    EXPECT_GT(found[0].score, 0.9);
    EXPECT_TRUE(test::near(found[0].corners_px[0], test::true_corners(pinhole_vga(), marker)[0], 1.0));
  }
}

TEST(Templates, AreWrittenInARToolKitsFormat) {
  const auto data = test::real_data("markers/artoolkit");
  if (!data) GTEST_SKIP() << "no photographs: markers/artoolkit";
  const std::string hiro = read_file(*data / "hiro.patt").value();
  TrainedTemplate same;
  std::size_t at = 0;
  for (auto& colour : same.bgr)
    for (int i = 0; i < 256; ++i) {
      std::size_t used = 0;
      colour.push_back(static_cast<std::uint8_t>(std::stoi(hiro.substr(at, 8), &used)));
      at += used;
    }
  const auto numbers = [](const std::string& text) {
    std::vector<int> values;
    std::istringstream stream(text);
    for (int value = 0; stream >> value;) values.push_back(value);
    return values;
  };
  EXPECT_EQ(numbers(template_text(same)), numbers(hiro));
}

TEST(Templates, TheHiroFrameTrainsHiro) {
  const auto data = test::real_data("markers/artoolkit");
  if (!data) GTEST_SKIP() << "no photographs: markers/artoolkit";
  const auto trained = train_template(read_image(*data / "hiro_frame_320x240.png").value());
  ASSERT_TRUE(trained) << trained.message();
  const auto learned = test::test_folder() / "learned.patt";
  ASSERT_TRUE(write_file(learned, template_text(*trained)));
  const auto templates =
      Families::load(std::vector{"artoolkit:" + (*data / "hiro.patt").string(), detected_text(learned)})
          .value();
  const auto pairs = compared(templates.templates());
  EXPECT_NE(pairs[0].a, pairs[0].b);
  EXPECT_GT(pairs[0].correlation, k_min_correlation);
}

TEST(Templates, TrainingSaysWhatIsWrongWithTheImage) {
  auto rng = test::test_rng();
  const auto folder = test::test_folder();
  const auto file = bars(folder, "bars.patt", 4);
  const auto message = [](const cv::Mat& image) {
    const auto trained = train_template(image);
    return trained ? std::string("trained") : trained.message();
  };
  const auto says = [&](const cv::Mat& image, const std::string& part) {
    EXPECT_NE(message(image).find(part), std::string::npos) << part << ": " << message(image);
  };
  says(test::plain(640, 480, 128), "found none");
  says(image_with({test::placed(pinhole_vga(), {"aruco_4x4_50", "3"}, {300, 200}, 120, 0.1, 0, 0)}, rng),
       "found none");
  says(image_with({placed(file, 150, 120, 0.1, 0), placed(file, 450, 90, 0.2, 0)}, rng),
       "found 2: at (150, 240) 120 px");
  says(image_with({placed(file, 300, 40, 0.1, 0)}, rng), "40 px wide, expected at least 64");
}

TEST(Templates, AreToldApartByTheDetectorsOwnLimits) {
  const auto folder = test::test_folder();
  const auto a = bars(folder, "a.patt", 4);
  const auto b = bars(folder, "b.patt", 5);
  std::string even;  // the same in all four rotations
  for (int block = 0; block < 12; ++block)
    for (int row = 0; row < 16; ++row)
      for (int column = 0; column < 16; ++column)
        even += row > 4 && row < 11 && column > 4 && column < 11 ? " 0" : " 255";
  ASSERT_TRUE(write_file(folder / "even.patt", even));
  const auto families =
      Families::load(std::vector{detected_text(a), detected_text(b), detected_text(folder / "even.patt")})
          .value();
  const auto pairs = compared(families.templates());
  ASSERT_EQ(pairs.size(), 6u);
  const auto of = [&](const std::string& x, const std::string& y) {
    for (const TemplateSimilarity& pair : pairs)
      if (pair.a == x && pair.b == y) return pair;
    return TemplateSimilarity{};
  };
  EXPECT_NEAR(of("even.patt", "even.patt").correlation, 1, 1e-6);
  EXPECT_EQ(of("even.patt", "even.patt").telling, Discriminability::confused);
  EXPECT_EQ(of("a.patt", "b.patt").quarter_turns, 0);
  EXPECT_EQ(of("a.patt", "b.patt").telling,
            of("a.patt", "b.patt").correlation > 0.9 ? Discriminability::confused : Discriminability::alike);
  EXPECT_GT(of("a.patt", "b.patt").correlation, 0.8);
  EXPECT_EQ(of("a.patt", "a.patt").telling, Discriminability::apart);
  // The detector does not read what the report calls confused.
  auto rng = test::test_rng();
  Detector detector(Families::load(std::vector{detected_text(folder / "even.patt")}).value());
  EXPECT_TRUE(detector.detect(image_with({placed(folder / "even.patt", 300, 120, 0, 0)}, rng)).empty());
}

// Two that differ by the width of a bar: they are told apart when sharp, and rejected when blurred.
TEST(Templates, NearlyAlikeAreDoubtedWhereTheyAreBlurred) {
  auto rng = test::test_rng();
  const auto folder = test::test_folder();
  const auto a = bars(folder, "a.patt", 4);
  const auto b = bars(folder, "b.patt", 6);
  Detector detector(Families::load(std::vector{detected_text(a), detected_text(b)}).value());
  int sharp = 0;
  int wrong = 0;
  for (int i = 0; i < 120; ++i) {
    const auto& file = i % 2 ? a : b;
    const bool is_sharp = i < 20;
    const PlacedMarker marker = placed(file, 320, is_sharp ? 140 : 32, 0.3 * i, is_sharp ? 20_deg : 60_deg);
    const cv::Mat image =
        test::image_of(pinhole_vga(), test::plain(640, 480, 110), std::vector{marker},
                       {.blur_px = is_sharp ? 0.7 : 2.5, .noise_levels = is_sharp ? 6.0 : 15.0}, rng);
    for (const Detection& detection : detector.detect(image)) {
      const bool right = detection.marker.id == file.filename();
      sharp += right && is_sharp;
      wrong += !right;
    }
  }
  EXPECT_EQ(sharp, 20);
  EXPECT_LE(wrong, 2);  // 15 of 120 when none is rejected
}

}  // namespace
}  // namespace limn::tracker
