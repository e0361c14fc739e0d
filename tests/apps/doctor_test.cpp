#include "apps/doctor.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "core/file.h"
#include "core/image_io.h"
#include "core/rig.h"
#include "tests/device/loopback_server.h"
#include "tests/device/mjpeg_answer.h"
#include "tests/support/display.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"
#include "tests/support/text.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using State = Finding::State;
using test::expect_contains;
using test::Outcome;

// The first finding of that area and name; an empty name fits all.
Finding found(const std::vector<Finding>& findings, const std::string& area, const std::string& name = "") {
  for (const Finding& finding : findings)
    if (finding.area == area && (name.empty() || finding.name == name)) return finding;
  ADD_FAILURE() << "no finding " << area << " " << name;
  return {};
}

fs::path devices_file(const std::string& cameras, const std::string& displays) {
  const fs::path file = test::test_folder() / "devices.json";
  EXPECT_TRUE(
      write_file(file, fmt::format(R"({{"schema": "limn.devices/1", "cameras": [{}], "displays": [{}]}})",
                                   cameras, displays)));
  return file;
}

TEST(Doctor, LooksAtThisMachine) {
  const auto findings = examined({});
  const Finding clock = found(findings, "clock");
  EXPECT_EQ(clock.state, State::works);
  expect_contains(clock.text, "monotonic, resolution");
  const Finding gl = found(findings, "gl");
  EXPECT_EQ(gl.state, State::works) << gl.text;
  expect_contains(gl.text, "4.5");
  if (!test::has_desktop()) {
    EXPECT_EQ(found(findings, "displays").state, State::note);  // nobody asked for it
    expect_contains(found(findings, "displays").text, "set DISPLAY");
  }
  found(findings, "cameras");
}

TEST(Doctor, MissingPackagesAreNamed) {
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "packages.txt", "# a list\nbread\nbutter # salted\n\nham\ncheese\n"));
  ASSERT_TRUE(write_file(
      folder / "status",
      "Package: bread\nStatus: install ok installed\n\nPackage: butter\nStatus: hold ok installed\n\n"
      "Package: ham\nStatus: deinstall ok config-files\n"));
  const auto missing =
      found(examined({.packages = folder / "packages.txt", .installed = folder / "status"}), "packages");
  EXPECT_EQ(missing.state, State::fails);
  EXPECT_EQ(missing.text, "missing: ham cheese");
  expect_contains(missing.advice, "apt-get install --no-install-recommends --no-remove ham cheese");
  ASSERT_TRUE(write_file(folder / "packages.txt", "bread\nbutter\n"));
  const auto all =
      found(examined({.packages = folder / "packages.txt", .installed = folder / "status"}), "packages");
  EXPECT_EQ(all.state, State::works);
  const auto elsewhere = found(examined({.installed = folder / "nowhere"}), "packages");
  EXPECT_EQ(elsewhere.state, State::note);
}

TEST(Doctor, APackageOfAnotherReleaseIsNotMissing) {
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "packages.txt", "bread [bookworm]\nrolls [trixie] # since 2025\nbutter\n"));
  ASSERT_TRUE(write_file(folder / "status", "Package: butter\nStatus: install ok installed\n"));
  ASSERT_TRUE(write_file(folder / "os-release", "ID=debian\nVERSION_CODENAME=trixie\n"));
  const auto missing = found(examined({.packages = folder / "packages.txt",
                                       .installed = folder / "status",
                                       .release = folder / "os-release"}),
                             "packages");
  EXPECT_EQ(missing.text, "missing: rolls");
}

TEST(Doctor, DevicesThatWorkAreOpenedAndMeasured) {
  test::LoopbackServer server(test::stream_grey);
  const fs::path file = devices_file(
      fmt::format(
          R"({{"name": "camera0", "source": "http://sam:secret@127.0.0.1:{}/"}}, {{"name": "camera1", "source": "one.png"}})",
          server.port()),
      R"({"name": "projector0", "monitor": "offscreen", "size": [320, 200]})");
  ASSERT_TRUE(write_png(file.parent_path() / "one.png", cv::Mat(6, 8, CV_8U, cv::Scalar(9))));
  const auto findings = examined({.devices = file});
  const Finding stream = found(findings, "devices", "camera0");
  EXPECT_EQ(stream.state, State::works) << stream.text;
  expect_contains(stream.text, "64x48, ");
  EXPECT_EQ(stream.text.find("secret"), std::string::npos) << stream.text;
  const double rate = std::atof(stream.text.c_str() + stream.text.find(", ") + 2);
  EXPECT_GT(rate, 20);
  EXPECT_LT(rate, 51);
  expect_contains(found(findings, "devices", "camera1").text, "8x6 [");
  const Finding display = found(findings, "devices", "projector0");
  EXPECT_EQ(display.state, State::works);
  EXPECT_EQ(display.text, "offscreen: 320x200");
}

TEST(Doctor, WhatDoesNotWorkIsNamedAndTheRestGoesOn) {
  const fs::path file = devices_file(R"({"name": "camera0", "source": "v4l2:/dev/nowhere"})",
                                     R"({"name": "projector0", "monitor": "NOWHERE-1", "size": [320, 200]},
                                        {"name": "screen", "monitor": "offscreen", "size": [8, 6]})");
  auto findings = examined({.devices = file});
  EXPECT_EQ(found(findings, "devices", "camera0").state, State::fails);
  expect_contains(found(findings, "devices", "camera0").text, "Plug the camera in");
  EXPECT_EQ(found(findings, "devices", "projector0").state, State::fails);
  EXPECT_EQ(found(findings, "devices", "screen").state, State::works);
  if (!test::has_desktop()) {
    EXPECT_EQ(found(findings, "displays", "desktop").state, State::fails);
  }

  findings = examined({.devices = file.parent_path() / "absent.json"});
  EXPECT_EQ(found(findings, "devices", "file").state, State::fails);
  expect_contains(found(findings, "devices", "file").text, "absent.json");
  found(findings, "cameras");
}

TEST(Doctor, DevicesOfAnotherRigAreRefused) {
  const fs::path file = devices_file(R"({"name": "camera0", "source": "one.png"})", "");
  Rig rig;
  rig.cameras = {{"left", 8, 6, Lens::pinhole(8, 8, 3.5, 2.5), Pose()}};
  ASSERT_TRUE(save_rig(rig, file.parent_path() / "rig"));
  const auto findings = examined({.devices = file, .rig = file.parent_path() / "rig"});
  EXPECT_EQ(found(findings, "devices", "file").state, State::fails);
  expect_contains(found(findings, "devices", "file").text, "expected the rig's left");
}

TEST(Doctor, EachDisplayShowsItsOwnSign) {
  const fs::path file = devices_file("", R"({"name": "a", "monitor": "offscreen", "size": [320, 200]},
                                            {"name": "b", "monitor": "offscreen", "size": [64, 48]})");
  const auto begun = std::chrono::steady_clock::now();
  const auto findings = examined({.devices = file, .show_s = 0.3});
  EXPECT_GE(std::chrono::steady_clock::now() - begun, std::chrono::milliseconds(300));
  EXPECT_EQ(found(findings, "displays", "a").text, "shows the number 1 on red");
  EXPECT_EQ(found(findings, "displays", "b").text, "shows the number 2 on green");
}

TEST(Doctor, ShowsOnEveryMonitor) {
  if (!test::has_desktop()) GTEST_SKIP() << "no display: Doctor.ShowsOnEveryMonitor";
  const auto findings = examined({.show_s = 0.3});
  const Finding monitor = found(findings, "displays");
  EXPECT_EQ(monitor.state, State::works);
  expect_contains(monitor.text, "800x600 at");
  EXPECT_EQ(findings.back().name, monitor.name);
  EXPECT_EQ(findings.back().text, "shows the number 1 on red");
}

TEST(Doctor, ShowingWithoutADesktopIsAFailure) {
  if (test::has_desktop()) GTEST_SKIP() << "a display is there: Doctor.ShowingWithoutADesktopIsAFailure";
  const Finding desktop = found(examined({.show_s = 0.1}), "displays", "desktop");
  EXPECT_EQ(desktop.state, State::fails);
}

Outcome run(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "doctor");
  return test::run_limn(std::move(arguments));
}

TEST(Doctor, TheCommandsExitAndJsonSayWhetherAllWorks) {
  const fs::path good = devices_file(R"({"name": "camera0", "source": "one.png"})", "");
  ASSERT_TRUE(write_png(good.parent_path() / "one.png", cv::Mat(6, 8, CV_8U, cv::Scalar(9))));
  const Outcome works = run({"--devices", good.string(), "--json"});
  const auto report = nlohmann::json::parse(works.out);
  EXPECT_EQ(report["schema"], "limn.doctor/1");
  EXPECT_EQ(works.code, report["works"] == true ? 0 : 1) << works.out;
  ASSERT_TRUE(
      write_file(good, R"({"schema": "limn.devices/1", "cameras": [{"name": "camera0", "source": "two.png"}],
                                   "displays": []})"));
  const Outcome fails = run({"--devices", good.string(), "--json"});
  EXPECT_EQ(fails.code, 1);
  EXPECT_EQ(nlohmann::json::parse(fails.out)["works"], false);
  expect_contains(run({"--devices", good.string()}).out, "does not devices   camera0");
  EXPECT_EQ(run({"--rig", "rig"}).code, 2);
}

}  // namespace
}  // namespace limn::apps
