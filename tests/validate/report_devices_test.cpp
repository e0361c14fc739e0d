#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"
#include "validate/hardware_report/chosen_devices.h"
#include "validate/hardware_report/questions.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using test::expect_contains;

// What a person types.
class Answers {
 public:
  explicit Answers(const std::string& text) {
    EXPECT_EQ(pipe(ends_.data()), 0);
    EXPECT_EQ(write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  ~Answers() {
    close(ends_[0]);
    close(ends_[1]);
  }
  int read_end() const { return ends_[0]; }

 private:
  std::array<int, 2> ends_{};
};

struct Choice {
  ChosenDevices devices;
  std::string problem, printed;
};

// The devices that are chosen when these are plugged in and a person types these answers.
Choice chosen_with(const PluggedIn& plugged_in, const std::string& typed, const fs::path& file = {}) {
  const Answers answers(typed);
  Questions questions(answers.read_end());
  ReportCommands commands;
  commands.plugged_in = [&] { return plugged_in; };
  testing::internal::CaptureStdout();
  const auto chosen = choose_devices({.folder = "report", .devices = file}, commands, &questions);
  Choice choice;
  choice.printed = testing::internal::GetCapturedStdout();
  if (chosen) choice.devices = *chosen;
  if (!chosen) choice.problem = chosen.message();
  return choice;
}

TEST(ReportDevices, TheLastOfSeveralMonitorsIsTheProjectorUnlessAnotherIsNamed) {
  const PluggedIn desk{.cameras = {"v4l2:/dev/video0", "v4l2:/dev/video2"}, .monitors = {"eDP-1", "HDMI-1"}};
  const Choice usual = chosen_with(desk, "\n\n\n");
  ASSERT_EQ(usual.problem, "");
  EXPECT_EQ(usual.devices.named.cameras[0].source, "v4l2:/dev/video0");
  EXPECT_EQ(usual.devices.named.displays[0].monitor, "HDMI-1");
  const Choice other = chosen_with(desk, "v4l2:/dev/video2\nVGA-1\neDP-1\ncharuco:8x6:20mm\n");
  expect_contains(other.printed, "Expected one of eDP-1, HDMI-1, found VGA-1.");
  EXPECT_EQ(other.devices.named.cameras[0].source, "v4l2:/dev/video2");
  EXPECT_EQ(other.devices.named.displays[0].monitor, "eDP-1");
  EXPECT_EQ(other.devices.board, "charuco:8x6:20mm");
}

TEST(ReportDevices, TheOnlyMonitorIsNotCoveredUnlessAPersonWantsIt) {
  const PluggedIn laptop{.cameras = {"v4l2:/dev/video0"}, .monitors = {"eDP-1"}};
  const Choice usual = chosen_with(laptop, "\n\n\n");
  expect_contains(usual.printed, "eDP-1 is the only monitor.");
  expect_contains(usual.printed, "you could not read the questions");
  EXPECT_EQ(usual.devices.named.displays[0].kind, device::DisplayKind::offscreen);
  EXPECT_FALSE(usual.devices.is_virtual());
  const Choice wanted = chosen_with(laptop, "\nyes\n\n");
  EXPECT_EQ(wanted.devices.named.displays[0].monitor, "eDP-1");
  EXPECT_EQ(wanted.devices.named.displays[0].kind, device::DisplayKind::monitor);
}

TEST(ReportDevices, WithoutACameraTheVirtualRigIsUsedAndThatIsSaid) {
  const Choice none = chosen_with({.cameras = {}, .monitors = {"eDP-1"}}, "");
  EXPECT_TRUE(none.devices.is_virtual());
  expect_contains(none.printed, "no camera was found (monitors: eDP-1). The virtual rig is used.");
  const Choice blind =
      chosen_with({.cameras = {"v4l2:/dev/video0"}, .monitors = {}, .no_monitor = "Set DISPLAY."}, "\n\n");
  EXPECT_EQ(blind.devices.named.displays[0].kind, device::DisplayKind::offscreen);
  expect_contains(blind.printed,
                  "There is no monitor for a projector. Set DISPLAY. The camera is measured without");
}

TEST(ReportDevices, AFileWithoutACameraOrAProjectorIsAnError) {
  const fs::path file = test::test_folder() / "devices.json";
  ASSERT_TRUE(
      write_file(file, R"({"schema": "limn.devices/1", "cameras": [{"name": "a", "source": "one.png"}],
                                   "displays": [{"name": "screen", "monitor": "offscreen", "size": [8, 6]}]})"));
  expect_contains(
      chosen_with({}, "", file).problem,
      "devices.json: expected at least one camera and one display whose name begins with projector, found 1 "
      "cameras and 0 such displays.");
  ASSERT_TRUE(write_file(file, R"({"schema": "limn.devices/1", "cameras": [],
                                   "displays": [{"name": "projector0", "monitor": "HDMI-1"}]})"));
  expect_contains(chosen_with({}, "", file).problem, "found 0 cameras and 1 such displays.");
}

TEST(ReportDevices, PrivateNamesAreReplacedInDevicesAndTexts) {
  ChosenDevices devices;
  devices.named.cameras = {{.name = "camera0"}, {.name = "samantha_left"}};
  devices.named.displays = {{.name = "projector-samantha"}, {.name = "screen"}};
  PrivateWords words;
  words.add("samantha", "(user)");
  devices.named.cameras.push_back({.name = "192.168.7.20"});  // an address that nobody knows
  rename_private(&devices, &words);
  EXPECT_EQ(devices.named.cameras.back().name.find("192"), std::string::npos);
  EXPECT_EQ(devices.named.cameras[0].name, "camera0");
  EXPECT_EQ(devices.named.cameras[1].name, "camera1");
  EXPECT_EQ(devices.named.displays[0].name, "projector0");
  EXPECT_EQ(devices.named.displays[1].name, "screen");
  EXPECT_EQ(words.without("samantha_left is dark"), "camera1 is dark");
  EXPECT_EQ(devices.renamed.at("projector-samantha"), "projector0");
}

TEST(ReportDevices, TheMarkChangesWithDevicesBoardAndRig) {
  ChosenDevices devices;
  devices.named.cameras = {{.name = "camera0", .source = "v4l2:/dev/video0"}};
  devices.named.displays = {{.name = "projector0", .monitor = "HDMI-1"}};
  const std::string mark = devices_mark(devices, {});
  EXPECT_EQ(devices_mark(devices, {}), mark);
  EXPECT_NE(devices_mark(devices, "rig"), mark);
  ChosenDevices other = devices;
  other.named.displays[0].monitor = "HDMI-2";
  EXPECT_NE(devices_mark(other, {}), mark);
  other = devices;
  other.board = "charuco:8x6:20mm";
  EXPECT_NE(devices_mark(other, {}), mark);
  EXPECT_EQ(devices_mark({}, {}), "virtual rig");
}

TEST(Questions, CtrlCEndsTheWaitForAnAnswer) {
  const Answers answers("");
  Questions questions(answers.read_end());
  const Interruption interruption;
  std::jthread person([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    std::raise(SIGINT);
  });
  testing::internal::CaptureStdout();
  const auto begun = std::chrono::steady_clock::now();
  const auto answer = questions.ask("Which camera?", "camera0");
  testing::internal::GetCapturedStdout();
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(2));
  ASSERT_FALSE(answer);
  expect_contains(answer.message(), "interrupted at a question");
  EXPECT_TRUE(is_interrupted());
}

TEST(Questions, NoMoreAnswersMeanTheDefaults) {
  std::array<int, 2> ends{};
  ASSERT_EQ(pipe(ends.data()), 0);
  ASSERT_EQ(write(ends[1], "left\nlast", 9), 9);
  close(ends[1]);
  Questions questions(ends[0]);
  testing::internal::CaptureStdout();
  EXPECT_EQ(questions.ask("Which?", "right").value(), "left");
  EXPECT_EQ(questions.ask("Which?", "right").value(), "right");
  EXPECT_EQ(questions.ask("Which?", "right").value(), "right");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "Which? [right] Which? [right] \nWhich? [right] \n");
  close(ends[0]);
}

}  // namespace
}  // namespace limn::validate
