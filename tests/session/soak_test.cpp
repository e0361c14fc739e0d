// A long session with repeated failures: cameras and projectors fail and work again, images come in another
// size, a camera's clock steps, hands cover markers and block the light, files are damaged and repaired, the
// disk is full for a while. LIMN_SOAK_S: seconds of the session's clock (default 20).
#include "tests/support/soak.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "apps/live.h"
#include "core/file.h"
#include "core/stopwatch.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double k_period_s = 20;
constexpr int k_csv_columns = 12, k_lost = 9, k_placement = 11;

json events() {
  const auto edit = [](double at_s, const std::string& action, const std::string& value = "") {
    json what = {{"action", action}, {"value", value}};
    if (action == "next_variant") what["slot"] = "mirror";
    return json{{"at_s", at_s}, {"edit", what}};
  };
  const auto span = [](double from_s, double until_s, const std::string& what, const std::string& whose) {
    return json{{"at_s", from_s}, {"until_s", until_s}, {what, whose}};
  };
  const auto clock_step = [](double at_s, double seconds) {
    return json{{"at_s", at_s}, {"clock_step", "camera0"}, {"seconds", seconds}};
  };
  return {span(1, 2.5, "unplug", "camera0"),
          span(2, 3, "unplug", "projector0"),
          {{"at_s", 3.2}, {"until_s", 4.4}, {"resize", "camera0"}, {"size", {320, 240}}},
          span(4, 5, "unplug", "projector1"),
          span(6, 7.5, "block", "projector0"),
          span(7, 8, "block", "projector1"),
          span(8, 9, "cover", "aruco_4x4_50:0"),
          span(8.5, 9.5, "cover", "aruco_4x4_50:1"),
          {{"at_s", 10}, {"until_s", 12}, {"sway", "aruco_4x4_50:0"}, {"amplitude_m", {0.05, 0, 0}}},
          edit(12.5, "next_variant"),
          edit(13, "blackout", "on"),
          edit(13.3, "blackout", "off"),
          edit(13.6, "freeze", "on"),
          edit(14.2, "freeze", "off"),
          edit(14.4, "marker_states", "on"),
          edit(14.8, "save_look", "soaked"),
          edit(15, "marker_states", "off"),
          edit(15.2, "next_variant"),
          edit(15.4, "restore_look", "soaked"),
          edit(15.6, "restore_look", "there is none of that name"),
          edit(16, "screen", "next"),
          clock_step(10.6, 3600),
          clock_step(16.4, -7200),
          clock_step(17, 3595)};
}

// The last whole row of a session's telemetry.csv; empty before the first.
std::vector<double> last_row(const fs::path& path) {
  std::ifstream file(path, std::ios::ate);
  const auto size = file.tellg();
  file.seekg(std::max<std::streamoff>(0, size - std::streamoff(400)));
  std::vector<double> row, last;
  for (std::string line; std::getline(file, line) && !file.eof();) {
    row.clear();
    std::stringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');)
      row.push_back(std::strtod(field.c_str(), nullptr));
    if (row.size() == k_csv_columns) last = row;
  }
  return last;
}

// One long session; the tests look at what it left.
class Soak : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = test::test_folder();
    seconds_ = test::soak_s(k_period_s, k_period_s);
    copy_studio_to(folder_);
    json script = script_of(seconds_, events());
    script["again_every_s"] = k_period_s;
    apps::LiveOptions options;
    options.resolution = 0.34;
    options.frame_period_s = 0.2;  // below 0.3 s, after which a marker is lost and its filter starts again
    options.world = folder_ / "world.json";
    options.script = write_json(folder_ / "script.json", script);
    options.out = folder_ / "out";
    const std::string part = a_part();
    fs::create_directories(dropped().parent_path());
    std::atomic<bool> has_ended = false;
    std::thread outside([&] { disturb(part, has_ended); });
    const Status lived = apps::run_live(options);
    end_mib_ = test::resident_mib();
    has_ended = true;
    outside.join();
    ASSERT_TRUE(lived.ok()) << lived.message();
    summary_ = read_json(folder_ / "out/session.json");
  }

  // Saves a part, sometimes a damaged one, fills the disk at other times, and measures the memory.
  static void disturb(const std::string& whole, const std::atomic<bool>& has_ended) {
    const std::string broken = whole.substr(0, whole.size() / 2);
    const auto begun = std::chrono::steady_clock::now();
    double filled_at_s = -k_period_s;
    for (int i = 0; !has_ended; ++i) {
      std::ofstream(dropped(), std::ios::binary) << (i % 2 == 0 ? broken : whole);
      for (int k = 0; k < 30 && !has_ended; ++k) {
        const auto row = last_row(csv());
        const double at_s = row.empty() ? 0 : row[0], into_s = std::fmod(at_s, k_period_s);
        std::optional<test::SmallDisk> full;
        if (into_s > 1 && into_s < 4 && at_s > filled_at_s + k_period_s / 2) {
          full.emplace(100);
          filled_at_s = at_s;
        }
        // Waits for 1.6 s of the session's clock, at its speed so far.
        const double waited_s = full ? 1.6 * milliseconds_since(begun) / 1e3 / at_s : 0.1;
        std::this_thread::sleep_for(std::chrono::duration<double>(waited_s));
      }
      const auto row = last_row(csv());
      if (minute_mib_ == 0 && !row.empty() && row[0] > 60) minute_mib_ = test::resident_mib();
    }
  }

  // The bytes of one of the mirror's meshes.
  static std::string a_part() {
    for (const auto& entry : fs::directory_iterator(folder_ / "door"))
      if (entry.path().filename().string().starts_with("mirror") && entry.path().extension() == ".glb")
        return read_file(entry.path()).value();
    ADD_FAILURE() << "the door has no mirror";
    return "";
  }

  static fs::path dropped() { return folder_ / "door/slots/mirror/dropped.glb"; }
  static fs::path csv() { return folder_ / "out/telemetry.csv"; }
  static bool is_long() { return seconds_ > 1000; }
  // A long session keeps only its newest notes, so that two notes that belong together may not both be there.
  static int unpaired_at_most() { return is_long() ? 2 : 0; }

  // The number of notes that contain these words.
  static int notes(const std::string& words) {
    int count = 0;
    for (const json& note : summary_.at("notes"))
      count += note.at("what").get<std::string>().find(words) != std::string::npos;
    return count;
  }

  static inline fs::path folder_;
  static inline double seconds_ = 0, minute_mib_ = 0, end_mib_ = 0;
  static inline json summary_;
};

TEST_F(Soak, DevicesThatFailComeBack) {
  EXPECT_GE(notes(" is gone"), 3);
  EXPECT_LE(std::abs(notes(" is gone") - notes(" is back")), unpaired_at_most());
  EXPECT_GE(notes("found one of 320x240"), 1);
  EXPECT_GE(notes("clock has stepped"), 3);
  EXPECT_EQ(notes("has moved"), 0);
}

TEST_F(Soak, AFullDiskLosesNoRow) {
  const int full = notes("Its lines are kept");
  EXPECT_GE(full, 1);
  EXPECT_LE(std::abs(notes("can be written again") - full), unpaired_at_most());
  std::ifstream rows(csv());
  const auto lines = std::count(std::istreambuf_iterator<char>(rows), {}, '\n');
  EXPECT_EQ(static_cast<double>(lines), 1 + summary_.at("pictures").get<double>());
}

TEST_F(Soak, PartsStayInPlace) {
  const json& placement_mm = summary_.at("placement_mm");
  const double median_mm = placement_mm.at("median"), p95_mm = placement_mm.at("p95");
  std::printf("placement median %.2f, 95 %% %.2f, 99 %% %.2f mm\n", median_mm, p95_mm,
              placement_mm.at("p99").get<double>());
  EXPECT_LT(median_mm, 1);
  EXPECT_LT(p95_mm, 5);
  const auto last = last_row(csv());
  ASSERT_FALSE(last.empty());
  EXPECT_EQ(last[k_lost], 0);
  EXPECT_LT(last[k_placement], 1);
}

TEST_F(Soak, RunsToItsEndAndWritesWhatItWasAskedFor) {
  EXPECT_GT(summary_.at("seconds").get<double>(), seconds_ - 1);
  EXPECT_TRUE(fs::exists(folder_ / "door/looks/soaked.json"));
  EXPECT_TRUE(fs::exists(folder_ / "out/session.html"));
}

TEST_F(Soak, MemoryDoesNotGrow) {
  std::printf("%.0f s, memory %.1f MiB", seconds_, end_mib_);
  if (minute_mib_ > 0)
    std::printf(", after a minute %.1f MiB (%+.2f %%)", minute_mib_, 100 * (end_mib_ / minute_mib_ - 1));
  std::printf("\n");
  if (!is_long()) GTEST_SKIP() << "needs a session of more than 1000 s: LIMN_SOAK_S";
  EXPECT_GT(minute_mib_, 0);
  EXPECT_LT(end_mib_, 1.01 * minute_mib_);
}

}  // namespace
}  // namespace limn::session
