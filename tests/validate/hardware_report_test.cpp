#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "calib/capture_set.h"
#include "core/file.h"
#include "device/desktop.h"
#include "tests/device/loopback_server.h"
#include "tests/device/mjpeg_answer.h"
#include "tests/support/display.h"
#include "tests/support/matchers.h"
#include "tests/support/run_limn.h"
#include "tests/support/text.h"
#include "validate/hardware_report/frame_times.h"
#include "validate/hardware_report/private_words.h"
#include "validate/hardware_report/report.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::expect_contains;
using test::run_limn;

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

TEST(PrivateWords, TakesOutNamesAddressesAndSerialNumbers) {
  const PrivateWords words({{"/home/sam", "(home)"}, {"sam", "(user)"}, {"workshop", "(machine)"}});
  EXPECT_EQ(words.without("sam at workshop: /home/sam/rig, the same"),
            "(user) at (machine): (home)/rig, the same");
  EXPECT_EQ(words.without("gige:192.168.7.20 00:11:22:aa:bb:cc"), "gige:(address) (address)");
  EXPECT_EQ(words.without("mjpeg:http://cam.example.org:80/video"), "mjpeg:http://(address)/video");
  EXPECT_EQ(words.without("rtsp://admin:secret@192.168.7.20:554/s?user=a&password=b is silent"),
            "rtsp://(address)/s is silent");
  EXPECT_EQ(words.without("gige:Basler-21853478"), "gige:Basler-(serial)");
  EXPECT_EQ(words.without("Vendor-X100-22345678901 at 1920x1080, 59.940000 Hz"),
            "Vendor-X100-(serial) at 1920x1080, 59.940000 Hz");
}

// Runs a report and presses Ctrl-C as soon as its first step is written.
void expect_interruption(const fs::path& folder) {
  std::thread person([&] {
    for (int i = 0; i < 6000 && !fs::exists(folder / "report.json"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::raise(SIGINT);
  });
  const auto ended = run_limn({"doctor", "--report", folder.string(), "--live-seconds", "1"});
  person.join();
  EXPECT_EQ(ended.code, 1);
  expect_contains(ended.err, "interrupted in the step frames. What was measured is kept; the same command");
  const json steps = report_in(folder)["steps"];
  EXPECT_EQ(steps["machine"]["state"], "done");
  EXPECT_EQ(steps["frames"]["state"], "interrupted");
  EXPECT_FALSE(steps.contains("light"));
  EXPECT_TRUE(fs::exists(folder / "report.html"));
}

TEST(HardwareReport, RunsOnTheVirtualRigAfterAnInterruptionAndIsReadByReplayAndSolve) {
  const fs::path folder = test::test_folder() / "report";
  expect_interruption(folder);
  const auto made = run_limn({"doctor", "--report", folder.string(), "--live-seconds", "1"});
  ASSERT_EQ(made.code, 0) << made.err << made.out;
  EXPECT_EQ(made.out.find("machine …"), std::string::npos) << made.out;  // it is done
  const json report = report_in(folder);
  EXPECT_EQ(report["schema"], "limn.hardware_report/1");
  EXPECT_EQ(report["devices"], "virtual rig");
  for (const char* step : {"machine", "frames", "light", "capture", "live"})
    EXPECT_EQ(report["steps"][step]["state"], "done") << step << report["steps"][step].dump();
  const json& steps = report["steps"];
  EXPECT_NEAR(steps["frames"]["measured"]["period_ms"].get<double>(), 33.3, 0.5);
  EXPECT_NEAR(steps["light"]["measured"]["latency"]["projector0"]["ms"].get<double>(), 33, 3);
  EXPECT_GT(steps["capture"]["measured"]["board corners"]["camera0"].get<int>(), 20);
  EXPECT_GT(steps["live"]["measured"]["pictures"].get<int>(), 0);
  expect_contains(read_file(folder / "report.html").value(), "Limn hardware report");

  EXPECT_EQ(run_limn({"replay", (folder / "recording").string()}).code, 0);
  const auto captures = calib::load_captures(folder / "captures");
  ASSERT_TRUE(captures) << captures.message();
  EXPECT_EQ(captures->poses.size(), 1u);

  // What is done is not measured again.
  const auto stamps = fs::last_write_time(folder / "frames.csv");
  ASSERT_EQ(run_limn({"doctor", "--report", folder.string(), "--live-seconds", "1"}).code, 0);
  EXPECT_EQ(fs::last_write_time(folder / "frames.csv"), stamps);
}

// A report of an MJPEG camera that sees no light, and of this display.
void expect_report_without_light(const std::string& display) {
  const test::LoopbackServer server(test::stream_grey);
  const fs::path folder = test::test_folder(), devices = folder / "devices.json";
  ASSERT_TRUE(
      write_file(devices, fmt::format(R"({{"schema": "limn.devices/1", "cameras": [{{"name": "camera0", )"
                                      R"("source": "http://127.0.0.1:{}/"}}], "displays": [{}]}})",
                                      server.port(), display)));
  const auto made = run_limn({"doctor", "--report", (folder / "report").string(), "--devices",
                              devices.string(), "--live-seconds", "1"});
  ASSERT_EQ(made.code, 0) << made.err << made.out;
  const json report = report_in(folder / "report");
  EXPECT_EQ(report["devices"], "devices of this machine");
  for (const char* step : {"machine", "frames", "light", "capture", "live"})
    ASSERT_EQ(report["steps"][step]["state"], "done") << report["steps"][step].dump();
  EXPECT_NEAR(report["steps"]["frames"]["measured"]["period_ms"].get<double>(), 20, 8);
  EXPECT_EQ(report["steps"]["light"]["measured"]["latency"]["projector0"], "not measured");
  expect_contains(report["steps"]["light"]["odd"].dump(), "projector0");
  EXPECT_GT(report["steps"]["live"]["measured"]["pictures"].get<int>(), 0);
  EXPECT_EQ(run_limn({"replay", (folder / "report" / "recording").string()}).code, 0);
}

TEST(HardwareReport, SaysThatACameraDoesNotSeeTheLight) {
  expect_report_without_light(R"({"name": "projector0", "monitor": "offscreen", "size": [64, 48]})");
}

TEST(HardwareReport, ShowsOnAMonitor) {
  if (!test::has_desktop()) GTEST_SKIP() << "no display: HardwareReport.ShowsOnAMonitor";
  const std::string monitor = device::Desktop::open().value().monitors().front().name;
  expect_report_without_light(fmt::format(R"({{"name": "projector0", "monitor": "{}"}})", monitor));
}

TEST(HardwareReport, RefusesAFolderWithSomethingElse) {
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "report.json", R"({"schema": "limn.report/2"})"));
  const auto refused = run_limn({"doctor", "--report", folder.string()});
  EXPECT_EQ(refused.code, 1);
  expect_contains(refused.err, "expected a report of limn doctor (limn.hardware_report/1)");
  ASSERT_TRUE(write_file(folder / "report.json",
                         R"({"schema": "limn.hardware_report/1", "steps": {"machine": "damaged"}})"));
  const auto damaged = run_limn({"doctor", "--report", folder.string()});
  EXPECT_EQ(damaged.code, 1);
  expect_contains(damaged.err, "expected a report of limn doctor");
  fs::remove(folder / "report.json");
  ASSERT_TRUE(write_file(folder / "captures.json", "{}"));
  const auto full = run_limn({"doctor", "--report", folder.string()});
  EXPECT_EQ(full.code, 1);
  expect_contains(full.err, "expected a new or empty folder");
}

}  // namespace
}  // namespace limn::validate
