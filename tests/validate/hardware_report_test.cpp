#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "apps/doctor.h"
#include "core/file.h"
#include "device/desktop.h"
#include "tests/device/loopback_server.h"
#include "tests/device/mjpeg_answer.h"
#include "tests/support/display.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"
#include "tests/support/text.h"
#include "tests/validate/lit_board_camera.h"
#include "validate/hardware_report/frame_times.h"
#include "validate/hardware_report/report.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::expect_contains;
using test::Outcome;
using test::run_limn;

// Opens the camera, and the projector whose light it photographs.
class LitOpener final : public device::DeviceOpener {
 public:
  explicit LitOpener(test::LitBoardCamera* camera) : camera_(camera) {}
  Result<std::unique_ptr<device::Display>> display(const device::DisplayConfig& config) override {
    return camera_->projector(config.name);
  }
  Result<std::unique_ptr<device::CameraSource>> camera(const device::CameraConfig& config) override {
    return device::open_camera(config);
  }

 private:
  test::LitBoardCamera* camera_;
};

json report_in(const fs::path& folder) { return json::parse(read_file(folder / "report.json").value()); }

TEST(FrameRhythm, CountsMissingFramesAndJitter) {
  std::vector<FrameTime> times;
  const Stamp begun = now();
  for (int i = 0; i < 100; ++i) {
    if (i == 40 || i == 41) continue;
    const double at_s = 0.02 * i + (i % 2 == 0 ? 0.001 : 0);
    times.push_back({shifted(begun, at_s), shifted(begun, at_s + 0.03)});
  }
  const FrameRhythm rhythm = frame_rhythm(times);
  EXPECT_EQ(rhythm.frames, 98);
  EXPECT_EQ(rhythm.missing, 2);
  EXPECT_NEAR(rhythm.period_s, 0.02, 0.0011);
  EXPECT_NEAR(rhythm.jitter_s, 0.002, 0.0001);  // 19 and 21 ms
  EXPECT_NEAR(rhythm.delay_s, 0.03, 1e-6);
  const auto odd = odd_in(rhythm);
  ASSERT_EQ(odd.size(), 1u);
  expect_contains(odd[0], "2 of 100 are missing");
}

// The commands of `limn doctor --report` on a machine with nothing plugged in.
ReportCommands commands_of_a_bare_machine() {
  ReportCommands commands = apps::report_commands();
  commands.plugged_in = [] { return PluggedIn{}; };
  commands.answers = open("/dev/null", O_RDONLY);
  return commands;
}

// Runs a report in this process.
Outcome run_report(const ReportOptions& options,
                   const ReportCommands& commands = commands_of_a_bare_machine()) {
  testing::internal::CaptureStdout();
  const Status done = run_hardware_report(options, commands);
  return {
      .code = done ? 0 : 1, .out = testing::internal::GetCapturedStdout(), .err = done ? "" : done.message()};
}

// Presses Ctrl-C when this file is there and has this text.
std::jthread interrupting_at(const fs::path& file, const std::string& text = "") {
  return std::jthread([file, text] {
    const auto is_there = [&] {
      if (!fs::exists(file)) return false;
      const auto found = read_file(file);
      return found && found->find(text) != std::string::npos;
    };
    for (int i = 0; i < 6000 && !is_there(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::raise(SIGINT);
  });
}

void expect_state(const json& report, const std::string& step, const std::string& state) {
  EXPECT_EQ(report["steps"][step].value("state", ""), state) << step << report["steps"][step].dump();
}

// Interrupts a report in the step frames, and in the second placement of the board.
void expect_interruptions(const ReportOptions& options) {
  {
    const std::jthread person = interrupting_at(options.folder / "report.json", "\"done\"");
    const Outcome ended = run_report(options);
    EXPECT_EQ(ended.code, 1);
    expect_contains(ended.err, "interrupted in the step frames. What was measured is kept; the same command");
  }
  json report = report_in(options.folder);
  expect_state(report, "machine", "done");
  expect_state(report, "frames", "interrupted");
  EXPECT_FALSE(report["steps"].contains("light"));
  EXPECT_TRUE(fs::exists(options.folder / "report.html"));
  {
    const std::jthread person = interrupting_at(options.folder / "captures/pose01/camera0/003.png");
    expect_contains(run_report(options).err, "interrupted in the step capture.");
  }
  expect_state(report_in(options.folder), "capture", "interrupted");
  EXPECT_FALSE(fs::exists(options.folder / "captures/pose01/camera0/043.png"));
}

TEST(HardwareReport, RunsOnTheVirtualRigAfterInterruptionsAndIsReadByReplayAndSolve) {
  const ReportOptions options{.folder = test::test_folder() / "report", .placements = 3, .live_s = 1};
  expect_interruptions(options);
  const auto first = fs::last_write_time(options.folder / "captures/pose00/camera0/043.png");
  const Outcome made = run_report(options);
  ASSERT_EQ(made.code, 0) << made.err << made.out;
  EXPECT_EQ(made.out.find("machine …"), std::string::npos) << made.out;  // it is done
  EXPECT_EQ(fs::last_write_time(options.folder / "captures/pose00/camera0/043.png"), first);
  const json report = report_in(options.folder);
  EXPECT_EQ(report["schema"], "limn.hardware_report/1");
  EXPECT_EQ(report["devices"], "virtual rig");
  for (const char* step : {"machine", "frames", "light", "capture", "live"})
    expect_state(report, step, "done");
  const json& steps = report["steps"];
  EXPECT_NEAR(steps["frames"]["measured"]["period_ms"].get<double>(), 33.3, 0.5);
  EXPECT_NEAR(steps["light"]["measured"]["latency"]["projector0"]["ms"].get<double>(), 33, 3);
  EXPECT_EQ(steps["capture"]["odd"].dump(), "[]");
  EXPECT_GT(steps["live"]["measured"]["pictures"].get<int>(), 0);
  expect_contains(read_file(options.folder / "report.html").value(), "Limn hardware report");

  EXPECT_EQ(run_limn({"replay", (options.folder / "recording").string()}).code, 0);
  const auto solved = run_limn({"solve", (options.folder / "captures").string(), "--out",
                                (options.folder.parent_path() / "rig").string()});
  EXPECT_EQ(solved.code, 0) << solved.err;
  expect_contains(solved.out, "usable: predicted error");

  // What is done is not measured again.
  const auto stamps = fs::last_write_time(options.folder / "frames.csv");
  ASSERT_EQ(run_report(options).code, 0);
  EXPECT_EQ(fs::last_write_time(options.folder / "frames.csv"), stamps);
}

fs::path devices_file(const std::string& cameras, const std::string& displays) {
  fs::path file = test::test_folder() / "devices.json";
  EXPECT_TRUE(
      write_file(file, fmt::format(R"({{"schema": "limn.devices/1", "cameras": [{}], "displays": [{}]}})",
                                   cameras, displays)));
  return file;
}

// A report of an MJPEG camera that sees no light, and of this display.
void expect_report_without_light(const std::string& display) {
  const test::LoopbackServer server(test::stream_grey);
  const fs::path devices = devices_file(
      fmt::format(R"({{"name": "camera0", "source": "http://127.0.0.1:{}/"}})", server.port()), display);
  const fs::path folder = devices.parent_path() / "report";
  ReportOptions options{.folder = folder, .devices = devices, .placements = 1, .live_s = 1};
  const Outcome made = run_report(options);
  ASSERT_EQ(made.code, 0) << made.err << made.out;
  const json report = report_in(folder);
  EXPECT_EQ(report["devices"], "devices of this machine");
  for (const char* step : {"machine", "frames", "light", "capture", "live"})
    expect_state(report, step, "done");
  EXPECT_NEAR(report["steps"]["frames"]["measured"]["period_ms"].get<double>(), 20, 8);
  EXPECT_EQ(report["steps"]["light"]["measured"]["latency"]["projector0"], "not measured");
  expect_contains(report["steps"]["light"]["odd"].dump(), "projector0");
  expect_contains(report["steps"]["capture"]["odd"].dump(), "0 of 1 placements; limn solve needs 3");
  EXPECT_GT(report["steps"]["live"]["measured"]["pictures"].get<int>(), 0);
  EXPECT_EQ(run_limn({"replay", (folder / "recording").string()}).code, 0);
  const auto refused =
      run_limn({"solve", (folder / "captures").string(), "--out", (folder.parent_path() / "rig").string()});
  EXPECT_EQ(refused.code, 1);
  expect_contains(refused.err, "camera0: expected the board in at least 3 poses, found it in 0.");

  // The same folder with names, or with other devices, is refused.
  options.with_names = true;
  expect_contains(run_report(options).err, "expected this report to be continued without --with-names");
  options.with_names = false;
  options.board = "charuco:8x6:20mm";
  expect_contains(run_report(options).err,
                  "expected the devices, board and rig that this report was begun with");
  options.devices.clear();
  expect_contains(run_report(options).err, "found others (virtual rig)");
}

TEST(HardwareReport, SaysThatACameraDoesNotSeeTheLight) {
  expect_report_without_light(R"({"name": "projector0", "monitor": "offscreen", "size": [16, 12]})");
}

TEST(HardwareReport, ShowsOnAMonitor) {
  if (!test::has_desktop()) GTEST_SKIP() << "no display: HardwareReport.ShowsOnAMonitor";
  const std::string monitor = device::Desktop::open().value().monitors().front().name;
  expect_report_without_light(fmt::format(R"({{"name": "projector0", "monitor": "{}"}})", monitor));
}

// What a report must not say: what the machine and the devices file know, and what the camera writes into
// images.
const std::vector<std::string> k_secrets = {"samantha", "workshop7",    "/home/samantha",    "ss'w0rd",
                                            "geheim77", "t0k3n",        "A1B2C3D4",          "21853478",
                                            "fe80::7",  "192.168.7.20", "00:11:22:aa:bb:cc", "127.0.0.1"};
const std::string k_owner = "Owner-of-the-camera";

// A machine whose tests and whose session write all of them.
ReportCommands commands_of_a_talkative_machine() {
  ReportCommands commands = commands_of_a_bare_machine();
  std::string all;
  for (const std::string& secret : k_secrets) all += secret + ", ";
  commands.examine = [all](const fs::path&) {
    return std::vector<Finding>{
        {"gl", "OpenGL 4.5", Finding::State::works, "driver 535.183.1.2, 123456789012 bytes", all},
        {"devices", "samantha_cam", Finding::State::fails,
         "http://samantha:pa/ss'w0rd@127.0.0.1/geheim77?token=t0k3n",
         "v4l2:/dev/v4l/by-id/usb-046d_C920_A1B2C3D4-video-index0 gige:Basler-acA1300-21853478"}};
  };
  commands.add_private_words = [](PrivateWords* words) {
    words->add("samantha", "(user)");
    words->add("/home/samantha", "(home)");
    words->add("workshop7", "(machine)");
    for (const char* serial : {"A1B2C3D4", "21853478"}) words->add(serial, "(serial)");
  };
  commands.play = [play = commands.play, all](const ReportSession& session, bool* was_interrupted) -> Status {
    LIMN_TRY_STATUS(play(session, was_interrupted));
    LIMN_TRY_STATUS(write_file(session.out / "session.log", all));
    LIMN_TRY_STATUS(write_file(session.out / "notes.csv", "at_s,what\n1234567.125,\"" + all + "\"\n"));
    LIMN_TRY_STATUS(write_file(session.record / "scene/pairings.json", all));
    return write_file(session.record / "scene/comments.json", all);
  };
  return commands;
}

// No file in the folder, and no file's name, says a secret.
void expect_no_secrets(const fs::path& folder) {
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = fs::relative(entry.path(), folder).string();
    const std::string content = entry.is_regular_file() ? read_file(entry.path()).value() : "";
    EXPECT_EQ(content.find(k_owner), std::string::npos) << name;
    for (const std::string& secret : k_secrets) {
      EXPECT_EQ(name.find(secret), std::string::npos) << name;
      EXPECT_EQ(content.find(secret), std::string::npos) << name << " has " << secret;
    }
    ++files;
  }
  EXPECT_GT(files, 150);
}

// Holds the board in three placements, and presses enter for each of them.
void hold_board(test::LitBoardCamera* camera, int answers, const fs::path& captures) {
  for (int placement = 0; placement < 3; ++placement) {
    camera->hold(placement);
    EXPECT_EQ(write(answers, "\n", 1), 1);
    const fs::path last = captures / fmt::format("pose{:02}/camera0/029.png", placement);
    for (int i = 0; i < 6000 && !fs::exists(last); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

TEST(HardwareReport, OverTheNetworkIsReadByReplayAndSolveAndSaysNoSecret) {
  test::LitBoardCamera camera(calib::Board::parse("charuco:8x6:25mm").value(), {128, 96}, k_owner);
  const fs::path devices = devices_file(
      fmt::format(
          R"({{"name": "samantha_cam", "source": "http://samantha:pa/ss'w0rd@127.0.0.1:{}/geheim77?token=t0k3n"}})",
          camera.port()),
      R"({"name": "projector0", "monitor": "offscreen", "size": [128, 96]})");
  const fs::path folder = devices.parent_path() / "report";
  ReportCommands commands = commands_of_a_talkative_machine();
  commands.opener = [&camera](const device::Desktop*) { return std::make_unique<LitOpener>(&camera); };
  std::array<int, 2> answers{};
  ASSERT_EQ(pipe(answers.data()), 0);
  commands.answers = answers[0];
  Outcome made;
  {
    const std::jthread person([&] { hold_board(&camera, answers[1], folder / "captures"); });
    made = run_report(
        {.folder = folder, .devices = devices, .board = "charuco:8x6:25mm", .placements = 3, .live_s = 1},
        commands);
  }
  ASSERT_EQ(made.code, 0) << made.err << made.out;
  const json report = report_in(folder);
  for (const char* step : {"machine", "frames", "light", "capture", "live"})
    expect_state(report, step, "done");
  EXPECT_EQ(report["steps"]["capture"]["odd"].dump(), "[]");
  EXPECT_TRUE(report["steps"]["light"]["measured"]["latency"]["projector0"].is_object()) << report.dump(1);
  expect_no_secrets(folder);
  EXPECT_EQ(report["steps"]["machine"]["measured"]["tests"][0]["text"],
            "driver 535.183.1.2, 123456789012 bytes");
  expect_contains(read_file(folder / "live/notes.csv").value(), "1234567.125,\"(user), (machine), (home), ");
  EXPECT_FALSE(fs::exists(folder / "recording/scene/comments.json"));
  EXPECT_FALSE(fs::exists(folder / "recording/scene/pairings.json"));

  EXPECT_EQ(run_limn({"replay", (folder / "recording").string()}).code, 0);
  const auto solved =
      run_limn({"solve", (folder / "captures").string(), "--out", (devices.parent_path() / "rig").string()});
  EXPECT_EQ(solved.code, 0) << solved.err << solved.out;
  EXPECT_TRUE(fs::exists(devices.parent_path() / "rig/rig.json"));
}

TEST(HardwareReport, CtrlCAtAQuestionEndsAtOnceAndTheReportGoesOn) {
  ReportCommands commands = commands_of_a_bare_machine();
  commands.plugged_in = [] { return PluggedIn{.cameras = {"v4l2:/dev/nowhere"}, .monitors = {"A", "B"}}; };
  std::array<int, 2> answers{};
  ASSERT_EQ(pipe(answers.data()), 0);
  commands.answers = answers[0];
  const fs::path folder = test::test_folder() / "report";
  std::jthread person([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    std::raise(SIGINT);
  });
  const Outcome ended = run_report({.folder = folder}, commands);
  EXPECT_EQ(ended.code, 1);
  expect_contains(ended.out, "Which camera (v4l2:/dev/nowhere)? [v4l2:/dev/nowhere]");
  expect_contains(ended.err,
                  "interrupted at a question. What was measured is kept; the same command goes on.");
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST(HardwareReport, RefusesAFolderWithSomethingElse) {
  const fs::path folder = test::test_folder();
  const auto expect_refusal = [&](const std::string& text) {
    ASSERT_TRUE(write_file(folder / "report.json", text));
    const Outcome refused = run_report({.folder = folder});
    EXPECT_EQ(refused.code, 1);
    expect_contains(refused.err, "expected a report of limn doctor (limn.hardware_report/1)");
  };
  expect_refusal(R"({"schema": "limn.report/2"})");
  expect_refusal(R"({"schema": 1, "steps": {}})");
  expect_refusal(R"({"schema": "limn.hardware_report/1", "steps": {"machine": "damaged"}})");
  expect_refusal(R"({"schema": "limn.hardware_report/1", "begun": 7, "steps": {}})");
  fs::remove(folder / "report.json");
  ASSERT_TRUE(write_file(folder / "captures.json", "{}"));
  const Outcome full = run_report({.folder = folder});
  EXPECT_EQ(full.code, 1);
  expect_contains(full.err, "expected a new or empty folder");
}

// The command line passes its options on; the file is checked before anything is measured.
TEST(HardwareReport, ADevicesFileWithoutAProjectorIsAnErrorOfTheCommand) {
  const fs::path devices = devices_file(R"({"name": "camera0", "source": "one.png"})", "");
  const auto refused = run_limn(
      {"doctor", "--report", (devices.parent_path() / "report").string(), "--devices", devices.string()});
  EXPECT_EQ(refused.code, 1);
  expect_contains(refused.err, "found 1 cameras and 0 such displays");
}

}  // namespace
}  // namespace limn::validate
