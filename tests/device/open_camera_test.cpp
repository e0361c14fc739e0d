#include "device/open_camera.h"

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "core/image_io.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::device {
namespace {

namespace fs = std::filesystem;
using test::expect_contains;

TEST(OpenCamera, ImagesFoldersAndVideosByTheirPath) {
  const fs::path folder = test::test_folder();
  fs::create_directory(folder / "pictures.d");
  ASSERT_TRUE(write_png(folder / "pictures.d/000.png", cv::Mat(6, 8, CV_8U, cv::Scalar(9))));
  cv::VideoWriter writer((folder / "clip.avi").string(), cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, {64, 48});
  writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(9)));
  writer.release();
  for (const char* source : {"pictures.d", "pictures.d/000.png", "clip.avi"}) {
    auto camera = open_camera({.name = "left", .source = (folder / source).string(), .grey = true});
    ASSERT_TRUE(camera) << camera.message();
    const auto frame = (*camera)->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_EQ(frame->camera, "left");
    EXPECT_EQ(frame->image.type(), CV_8UC1);
  }
}

TEST(OpenCamera, AnUnknownSourceListsTheForms) {
  for (const char* source : {"", "webcam", "/nowhere/at/all", "ftp://host/"}) {
    const auto camera = open_camera({.name = "left", .source = source});
    ASSERT_FALSE(camera);
    for (const char* form : {"left: ", "http://", "rtsp://", "folder of images"})
      expect_contains(camera.message(), form);
  }
}

TEST(OpenCamera, NetworkSourcesGoToTheirOwnReaders) {
  const auto mjpeg = open_camera({.source = "http://127.0.0.1:1/x", .limit_s = 0.1});
  ASSERT_FALSE(mjpeg);
  expect_contains(mjpeg.message(), "http://127.0.0.1:1/x): expected an image");
  const auto secure = open_camera({.source = "https://127.0.0.1/x", .limit_s = 0.1});
  ASSERT_FALSE(secure);
  expect_contains(secure.message(), "as http://");
  const auto rtsp = open_camera({.source = "rtsp://127.0.0.1:1/x", .limit_s = 0.1});
  ASSERT_FALSE(rtsp);
  const auto v4l2 = open_camera({.source = "v4l2:/dev/nowhere", .sensor = {.gain = 1}, .limit_s = 0.1});
  ASSERT_FALSE(v4l2);
  expect_contains(v4l2.message(), "camera0 (/dev/nowhere): expected an image");
  expect_contains(rtsp.message(), "rtsp://127.0.0.1:1/x): expected an image");
}

TEST(OpenCamera, ALoginIsInNoMessage) {
  // A password may have a slash or an @, so that an @ in a path may be in a password, too.
  for (const auto& [source, shown] : {std::pair{"http://sam:pa/ss@127.0.0.1:1/x", "http://127.0.0.1:1/x)"},
                                      {"http://sam:pass@127.0.0.1:1/x@y", "http://y)"},
                                      {"http://127.0.0.1:1/x?pwd=secret", "http://127.0.0.1:1/x?…)"}}) {
    const auto closed = open_camera({.source = source, .limit_s = 0.1});
    ASSERT_FALSE(closed);
    expect_contains(closed.message(), shown);
    expect_contains(closed.message(), "expected an image");
  }
  for (const char* source :
       {"https://sam:pa/ss@127.0.0.1/x", "ftp://sam:pa/ss@127.0.0.1/x", "ftp://sam:12/ss@127.0.0.1/x",
        "ftp://sam:pa?ss@127.0.0.1/x", "ftp://sam:p@x/ss@127.0.0.1/x"}) {
    const auto other = open_camera({.source = source, .limit_s = 0.1});
    ASSERT_FALSE(other);
    EXPECT_EQ(other.message().find("ss@"), std::string::npos) << other.message();
  }
}

TEST(OpenCamera, SettingsThatASourceHasNotAndOtherSizesAreRefused) {
  const fs::path image = test::test_folder() / "one.png";
  ASSERT_TRUE(write_png(image, cv::Mat(6, 8, CV_8U, cv::Scalar(9))));
  const auto set = open_camera({.source = image.string(), .sensor = {.exposure_ms = 8}});
  ASSERT_FALSE(set);
  expect_contains(set.message(), "exposure_ms cannot be set");
  const auto other = open_camera({.source = image.string(), .size = {640, 480}});
  ASSERT_FALSE(other);
  expect_contains(other.message(), "expected 640x480, found 8x6");
}

}  // namespace
}  // namespace limn::device
