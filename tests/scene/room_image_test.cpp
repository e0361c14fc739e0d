// Pictures of a room: files of linear light, directions, a scene's `light.image`.
#include "scene/room_image.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "scene/files/exr_image.h"
#include "scene/files/hdr_image.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using nlohmann::json;

const std::string k_head = "#?RADIANCE\n# made by a test\nFORMAT=32-bit_rle_rgbe\n";

std::string bytes(std::initializer_list<int> values) {
  std::string out;
  for (const int value : values) out += static_cast<char>(value);
  return out;
}

// Two rows of eight pixels: the first is packed, the second is not and repeats a pixel.
std::string two_rows() {
  std::string file = k_head + "EXPOSURE=2\n\n-Y 2 +X 8\n";
  file += bytes({2, 2, 0, 8});
  file += bytes({8, 10, 20, 30, 40, 50, 60, 70, 80});  // red, one by one
  file += bytes({128 + 8, 64});                        // green, a run
  file += bytes({128 + 4, 0, 128 + 4, 128});           // blue, two runs
  file += bytes({128 + 8, 129});                       // exponent
  for (int i = 0; i < 4; ++i) file += bytes({100, 50, 25, 128});
  return file + bytes({1, 1, 1, 4});
}

TEST(HdrImage, RadianceRowsArePackedOrNot) {
  const auto image = decode_hdr_image(two_rows(), "room.hdr");
  ASSERT_TRUE(image) << image.message();
  ASSERT_EQ(image->size(), cv::Size(8, 2));
  // 2^(129 - 136) / 2 for each step of the first row; BGR.
  EXPECT_EQ(image->at<cv::Vec3f>(0, 0), cv::Vec3f(0, 64, 10) / 256);
  EXPECT_EQ(image->at<cv::Vec3f>(0, 7), cv::Vec3f(128, 64, 80) / 256);
  for (int column = 0; column < 8; ++column)
    EXPECT_EQ(image->at<cv::Vec3f>(1, column), cv::Vec3f(25, 50, 100) / 512) << column;
}

TEST(HdrImage, OpenExrIsRead) {
  cv::Mat light(4, 8, CV_32FC3, cv::Scalar(2, 0.5, 0.25));  // red, green, blue
  light.at<cv::Vec3f>(3, 7) = {1e30F, 0, 1000};
  const auto image = decode_hdr_image(encode_exr(light, "").value(), "room.exr");
  ASSERT_TRUE(image) << image.message();
  ASSERT_EQ(image->size(), light.size());
  EXPECT_EQ(image->at<cv::Vec3f>(2, 3), cv::Vec3f(0.25F, 0.5F, 2));
  EXPECT_EQ(image->at<cv::Vec3f>(3, 7), cv::Vec3f(1000, 0, k_most_hdr_light)) << "the brightest is cut off";
}

TEST(HdrImage, WhatIsDamagedIsNamed) {
  const auto message = [](const std::string& file) {
    const auto image = decode_hdr_image(file, "room.hdr");
    return image ? std::string("(no error)") : image.message();
  };
  const auto expect = [](const std::string& found, const char* words) {
    EXPECT_NE(found.find(words), std::string::npos) << words << " in: " << found;
  };
  expect(message("PNG"), "Radiance (.hdr) or OpenEXR");
  expect(message("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n1234"), "FORMAT=32-bit_rle_rgbe");
  expect(message(k_head + "\n+X 2 -Y 2\n"), "-Y HEIGHT +X WIDTH");
  expect(message(k_head + "\n-Y 70000 +X 2\n"), "16384");
  expect(message(k_head + "EXPOSURE=0\n\n-Y 1 +X 1\n1234"), "EXPOSURE");
  expect(message(k_head + "\n-Y 1 +X 8\n" + bytes({2, 2, 0, 8, 128 + 9, 1}) + "12345678"), "a damaged row");
  cv::Mat none(2, 4, CV_32FC3, cv::Scalar::all(std::numeric_limits<float>::quiet_NaN()));
  expect(message(encode_exr(none, "").value()), "expected numbers");
  const std::string radiance = two_rows(), exr = encode_exr(cv::Mat::ones(4, 8, CV_32FC3), "").value();
  for (const std::string& whole : {radiance, exr})
    for (std::size_t size = 0; size < whole.size(); ++size)
      EXPECT_NE(message(whole.substr(0, size)), "(no error)") << size << " of " << whole.size();
}

Result<Scene> loaded(const json& light) {
  const auto folder = test::test_folder();
  cv::Mat room(2, 4, CV_32FC3, cv::Scalar::all(0));
  room.at<cv::Vec3f>(1, 2) = {3, 2, 1};  // below the horizon, a little right of the middle
  EXPECT_TRUE(write_file(folder / "room.exr", encode_exr(room, "").value()));
  EXPECT_TRUE(write_file(folder / "square.exr", encode_exr(room.colRange(0, 2), "").value()));
  const json scene = {{"schema", "limn.scene/1"}, {"slots", json::array()}, {"light", light}};
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump()));
  return load_scene(folder);
}

json light_with(const json& image) {
  return {{"up_world", {0, 0, 1}}, {"soft_below", {0, 0, 0}}, {"soft_above", {0, 0, 0}}, {"image", image}};
}

TEST(RoomImage, LiesInTheWorldAsTheSceneSays) {
  const auto scene = loaded(light_with({{"file", "room.exr"}, {"towards_world", {0, 2, 5}}}));
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_EQ(scene->light->image_strength, 1);
  // Ahead is y, so that right is x.
  const double right = M_PI / 4, down = M_PI / 4;
  const Eigen::Vector3d d(std::cos(down) * std::sin(right), std::cos(down) * std::cos(right),
                          -std::sin(down));
  EXPECT_TRUE(test::near(scene->room_image->from(d).cast<double>(), Eigen::Vector3d(1, 2, 3), 1e-3));
  EXPECT_TRUE(test::near(scene->room_image->from(-d).cast<double>(), Eigen::Vector3d::Zero().eval(), 1e-3));
  EXPECT_NEAR(scene->room_image->from({0, 1, -1e-9}).x(), 0.25, 1e-3) << "between four pixels";
}

TEST(RoomImage, WhatIsWrongIsNamedAndALookKeepsItsStrength) {
  const auto expect = [](const json& light, const char* words) {
    const auto scene = loaded(light);
    const std::string found = scene ? "(no error)" : scene.message();
    EXPECT_NE(found.find(words), std::string::npos) << words << " in: " << found;
  };
  expect(light_with({{"file", "none.exr"}, {"towards_world", {0, 1, 0}}}), "none.exr");
  expect(light_with({{"file", "square.exr"}, {"towards_world", {0, 1, 0}}}), "twice as wide as high");
  expect(light_with({{"file", "room.exr"}, {"towards_world", {0, 0, 1}}}), "not straight up or down");
  json strong = light_with({{"file", "room.exr"}, {"towards_world", {0, 1, 0}}});
  strong["image_strength"] = -1;
  expect(strong, "light.image_strength: expected 0 to 10");
  strong["image_strength"] = 0.5;
  const auto scene = loaded(strong);
  ASSERT_TRUE(scene) << scene.message();
  const Look look{"a", {}, scene->light};
  const auto file = test::test_folder() / "look.json";
  ASSERT_TRUE(write_file(file, look_json(look)));
  const auto read = load_look(file, *scene);
  ASSERT_TRUE(read) << read.message();
  EXPECT_EQ(read->light->image_strength, 0.5);
}

}  // namespace
}  // namespace limn::scene
