#include "device/devices_file.h"

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::device {
namespace {

namespace fs = std::filesystem;
using test::expect_contains;

Result<Devices> loaded(const std::string& cameras, const std::string& displays = "") {
  const fs::path file = test::test_folder() / "devices.json";
  EXPECT_TRUE(
      write_file(file, fmt::format(R"({{"schema": "limn.devices/1", "cameras": [{}], "displays": [{}]}})",
                                   cameras, displays)));
  return load_devices(file);
}

std::string problem(const std::string& cameras, const std::string& displays = "") {
  const auto devices = loaded(cameras, displays);
  return devices ? "read without a problem" : devices.message();
}

Rig studio_rig() {
  Rig rig;
  for (const char* name : {"camera0", "camera1"})
    rig.cameras.push_back({name, 1280, 720, Lens::pinhole(900, 900, 639.5, 359.5), Pose()});
  for (const char* name : {"projector0", "projector1"})
    rig.projectors.push_back({name, 1920, 1080, Lens::pinhole(2000, 2000, 959.5, 539.5), Pose()});
  return rig;
}

TEST(Devices, TheExampleIsReadAndFitsItsRig) {
  const auto devices = load_devices(fs::path(LIMN_SOURCE_DIR) / "config/devices/studio.json");
  ASSERT_TRUE(devices) << devices.message();
  ASSERT_EQ(devices->cameras.size(), 2u);
  EXPECT_EQ(devices->cameras[0].source, "v4l2:/dev/video0");
  EXPECT_EQ(devices->cameras[0].size, cv::Size(1280, 720));
  EXPECT_EQ(devices->cameras[0].sensor.exposure_ms, 8);
  EXPECT_EQ(devices->cameras[0].sensor.gain, 0);
  EXPECT_EQ(devices->cameras[0].sensor.white_balance_k, 5000);
  EXPECT_EQ(devices->cameras[1].source, "gige:192.168.1.20");
  EXPECT_FALSE(devices->cameras[1].sensor.white_balance_k);
  ASSERT_EQ(devices->displays.size(), 3u);
  EXPECT_EQ(devices->displays[0].monitor, "HDMI-1");
  EXPECT_NEAR(devices->displays[0].latency_s, 0.035, 1e-12);
  const auto fitted = matched(*devices, studio_rig());
  ASSERT_TRUE(fitted) << fitted.message();
  EXPECT_EQ(fitted->cameras[1].size, cv::Size(1280, 720));
  EXPECT_EQ(fitted->displays[1].size, cv::Size(1920, 1080));
  EXPECT_EQ(fitted->displays[2].size, cv::Size(1920, 1080));  // the size in the file
}

const std::string k_camera = R"({"name": "camera0", "source": "v4l2:/dev/video0"})";

TEST(Devices, AScreenCanBeForTwoEyesAndStandInTheWorld) {
  const auto devices = loaded(k_camera, R"({"name": "wall", "monitor": "HDMI-1", "stereo": "top_bottom",
      "wall_mm": [[-1000, 500, 1500], [1000, 500, 1500], [-1000, 500, 300]]},
      {"name": "projector0", "monitor": "HDMI-2"})");
  ASSERT_TRUE(devices) << devices.message();
  EXPECT_EQ(devices->displays[0].stereo, StereoLayout::top_bottom);
  ASSERT_TRUE(devices->displays[0].wall);
  EXPECT_LT((devices->displays[0].wall->bottom_left - Eigen::Vector3d(-1, 0.5, 0.3)).norm(), 1e-12);
  EXPECT_EQ(devices->displays[1].stereo, StereoLayout::off);
  EXPECT_FALSE(devices->displays[1].wall);
}

TEST(Devices, AWallThatIsNoneIsNamed) {
  const auto found = [](const std::string& more) {
    return problem(k_camera, R"({"name": "wall", "monitor": "HDMI-1", )" + more + "}");
  };
  expect_contains(found(R"("stereo": "3d")"), "stereo: expected");
  expect_contains(found(R"("stereo": "3d")"), "frame_sequential");
  expect_contains(found(R"("wall_mm": [[0, 0, 0], [1, 0, 0]])"), "wall_mm: expected the top left, top right");
  expect_contains(found(R"("wall_mm": [[0, 0, 0], [900, 0, 0], [400, 0, -700]])"),
                  "found an angle of 60.3 degrees");
  expect_contains(found(R"("wall_mm": [[0, 0, 0], [900, 0, 0], [0, 0]])"), "wall_mm[2]: expected");
  const auto devices = loaded(R"({"name": "camera0", "source": "v4l2:/dev/video0"},
                                 {"name": "camera1", "source": "v4l2:/dev/video1"})",
                              R"({"name": "projector0", "monitor": "HDMI-1",
                                  "wall_mm": [[0, 0, 0], [900, 0, 0], [0, 0, -700]]},
                                 {"name": "projector1", "monitor": "HDMI-2"})");
  ASSERT_TRUE(devices) << devices.message();
  const auto fitted = matched(*devices, studio_rig());
  ASSERT_FALSE(fitted);
  expect_contains(fitted.message(), "projector0: expected wall_mm at a screen only");
}

TEST(Devices, FilesAreNamedFromTheFilesFolder) {
  const auto devices = loaded(
      R"({"name": "a", "source": "clips/one.mp4"}, {"name": "b", "source": "/data/pictures"},
         {"name": "c", "source": "http://host:8080/a:b"}, {"name": "d", "source": "rtsp://host/"})");
  ASSERT_TRUE(devices) << devices.message();
  EXPECT_EQ(devices->cameras[0].source, (devices->file.parent_path() / "clips/one.mp4").string());
  EXPECT_EQ(devices->cameras[1].source, "/data/pictures");
  EXPECT_EQ(devices->cameras[2].source, "http://host:8080/a:b");
  EXPECT_EQ(devices->cameras[3].source, "rtsp://host/");
}

TEST(Devices, WhatIsWrongIsNamedWithItsPlace) {
  expect_contains(problem(R"({"name": "camera0"})"), "cameras[0].source: this key is missing");
  expect_contains(problem(R"({"name": "camera0", "source": "v4l2:/dev/video0", "exposure": 3})"), "exposure");
  expect_contains(problem(R"({"name": "camera0", "source": ""})"),
                  "cameras[0].source: expected a camera's source");
  expect_contains(problem(R"({"name": "camera0", "source": "x", "exposure_ms": -1})"),
                  "cameras[0].exposure_ms: expected a");
  expect_contains(problem(R"({"name": "camera0", "source": "x", "size": [640.5, 480]})"),
                  "cameras[0].size: expected");
  expect_contains(problem("", R"({"name": "p", "monitor": "offscreen", "latency_ms": -3})"),
                  "displays[0].latency_ms");
  expect_contains(problem("", R"({"name": "p"})"), "displays[0].monitor: this key is missing");
  expect_contains(problem(R"({"name": "a", "source": "x"}, {"name": "a", "source": "y"})"),
                  "cameras[1]: expected a name");
  expect_contains(
      problem(R"({"name": "a", "source": "v4l2:/dev/video0"}, {"name": "b", "source": "v4l2:/dev/video0"})"),
      "cameras[1]: expected a source of its own, found v4l2:/dev/video0, which a ");
  expect_contains(problem("", R"({"name": "p", "monitor": "HDMI-1"}, {"name": "q", "monitor": "HDMI-1"})"),
                  "displays[1]: expected a monitor of its own, found HDMI-1, which p ");
  EXPECT_TRUE(loaded("", R"({"name": "p", "monitor": "window"}, {"name": "q", "monitor": "window"})"));
}

TEST(Devices, OfAnotherRigAreRefusedAndNamed) {
  const std::string camera0 = R"({"name": "camera0", "source": "x"})",
                    camera1 = R"({"name": "camera1", "source": "y"})";
  const std::string projectors =
      R"({"name": "projector0", "monitor": "A"}, {"name": "projector1", "monitor": "B"})";
  const auto refused = [&](const std::string& cameras, const std::string& displays) {
    const auto fitted = matched(loaded(cameras, displays).value(), studio_rig());
    return fitted ? "fits" : fitted.message();
  };
  EXPECT_EQ(refused(camera0 + "," + camera1, projectors), "fits");
  expect_contains(refused(camera0, projectors), "cameras: expected the rig's camera1 among them");
  expect_contains(refused(camera0 + "," + camera1, R"({"name": "projector0", "monitor": "A"})"),
                  "the rig's projector1");
  expect_contains(refused(camera0 + "," + camera1 + R"(, {"name": "left", "source": "z"})", projectors),
                  "expected those of the rig (camera0, camera1), found left");
  expect_contains(
      refused(R"({"name": "camera0", "source": "x", "size": [640, 480]}, )" + camera1, projectors),
      "camera0: expected the rig's size 1280x720, found 640x480");
  expect_contains(
      refused(
          camera0 + "," + camera1,
          R"({"name": "projector0", "monitor": "A", "size": [1280, 800]}, {"name": "projector1", "monitor": "B"})"),
      "projector0: expected the rig's size 1920x1080, found 1280x800");
}

TEST(Devices, ACameraMaySeeInfraredLight) {
  const auto devices = loaded(R"({"name": "camera0", "source": "a.png"},
                                {"name": "camera1", "source": "b.png", "sees": "infrared"})");
  ASSERT_TRUE(devices) << devices.message();
  EXPECT_EQ(devices->cameras[0].sees, Spectrum::visible);
  EXPECT_EQ(devices->cameras[1].sees, Spectrum::infrared);
  for (const char* part : {"cameras[0].sees", "visible, infrared", "heat"})
    expect_contains(problem(R"({"name": "camera0", "source": "a.png", "sees": "heat"})"), part);
}

}  // namespace
}  // namespace limn::device
