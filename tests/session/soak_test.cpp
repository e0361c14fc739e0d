// A long session with repeated failures: cameras and projectors fail and work again, images come in another
// size, a camera's clock steps, hands cover markers and block the light, files are damaged and repaired, the
// disk is full for a while. LIMN_SOAK_S: seconds of the session's clock (default 20).
#include <gtest/gtest.h>
#include <unistd.h>

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

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double k_period_s = 20;
constexpr int k_csv_columns = 12, k_lost = 9, k_placement = 11;

double soak_s() {
  const char* wanted = std::getenv("LIMN_SOAK_S");
  return wanted ? std::max(k_period_s, std::strtod(wanted, nullptr)) : k_period_s;
}

double resident_mib() {
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

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

TEST(Soak, ALongSessionWithAllThatGoesWrong) {
  const fs::path folder = test::test_folder();
  copy_studio_to(folder);
  const double seconds = soak_s();
  json script = script_of(seconds, events());
  script["again_every_s"] = k_period_s;
  written(folder / "script.json", script);
  const fs::path dropped = folder / "door/slots/mirror/dropped.glb", csv = folder / "out/telemetry.csv";
  fs::create_directories(dropped.parent_path());
  fs::path part;
  for (const auto& entry : fs::directory_iterator(folder / "door"))
    if (entry.path().filename().string().starts_with("mirror") && entry.path().extension() == ".glb")
      part = entry.path();
  ASSERT_FALSE(part.empty());
  const std::string whole = read_file(part).value(), broken = whole.substr(0, whole.size() / 2);

  std::atomic<bool> has_ended = false;
  double minute_mib = 0;
  // Another thread saves a part, sometimes a damaged one, fills the disk at other times, and measures the
  // memory.
  std::thread outside([&] {
    const auto begun = std::chrono::steady_clock::now();
    double filled_at_s = -k_period_s;
    for (int i = 0; !has_ended; ++i) {
      std::ofstream(dropped, std::ios::binary) << (i % 2 == 0 ? broken : whole);
      for (int k = 0; k < 30 && !has_ended; ++k) {
        const auto row = last_row(csv);
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
      const auto row = last_row(csv);
      if (minute_mib == 0 && !row.empty() && row[0] > 60) minute_mib = resident_mib();
    }
  });
  LiveOptions options;
  options.resolution = 0.34;
  options.frame_period_s = 0.2;  // below 0.3 s, after which a marker is lost and its filter starts again
  options.world = folder / "world.json";
  options.script = folder / "script.json";
  options.out = folder / "out";
  const Status lived = run_live(options);
  const double end_mib = resident_mib();
  has_ended = true;
  outside.join();
  ASSERT_TRUE(lived.ok()) << lived.message();

  const json summary = read_json(folder / "out/session.json");
  int gone = 0, back = 0, resized = 0, stepped = 0, moved = 0, full = 0, written_again = 0;
  for (const json& note : summary.at("notes")) {
    const std::string what = note.at("what");
    gone += what.find(" is gone") != std::string::npos;
    back += what.find(" is back") != std::string::npos;
    resized += what.find("found one of 320x240") != std::string::npos;
    stepped += what.find("clock has stepped") != std::string::npos;
    moved += what.find("has moved") != std::string::npos;
    full += what.find("Its lines are kept") != std::string::npos;
    written_again += what.find("can be written again") != std::string::npos;
  }
  std::printf("%.0f s, memory %.1f MiB", seconds, end_mib);
  if (minute_mib > 0)
    std::printf(", after a minute %.1f MiB (%+.2f %%)", minute_mib, 100 * (end_mib / minute_mib - 1));
  std::printf("\nplacement median %.2f, 95 %% %.2f, 99 %% %.2f mm\n",
              summary.at("placement_mm").at("median").get<double>(),
              summary.at("placement_mm").at("p95").get<double>(),
              summary.at("placement_mm").at("p99").get<double>());
  EXPECT_GE(gone, 3);
  EXPECT_LE(std::abs(gone - back), seconds > 1000 ? 2 : 0);  // a long session keeps only its newest notes
  EXPECT_GE(resized, 1);
  EXPECT_GE(stepped, 3);
  EXPECT_EQ(moved, 0);
  EXPECT_GE(full, 1);
  EXPECT_LE(std::abs(written_again - full), seconds > 1000 ? 2 : 0);
  std::ifstream rows(csv);
  const auto lines = std::count(std::istreambuf_iterator<char>(rows), {}, '\n');
  EXPECT_EQ(static_cast<double>(lines), 1 + summary.at("pictures").get<double>()) << "no row is lost";
  EXPECT_GT(summary.at("seconds").get<double>(), seconds - 1);
  EXPECT_LT(summary.at("placement_mm").at("median").get<double>(), 1);
  EXPECT_LT(summary.at("placement_mm").at("p95").get<double>(), 5);
  const auto last = last_row(csv);
  ASSERT_FALSE(last.empty());
  EXPECT_EQ(last[k_lost], 0);
  EXPECT_LT(last[k_placement], 1);
  EXPECT_TRUE(fs::exists(folder / "door/looks/soaked.json"));
  EXPECT_TRUE(fs::exists(folder / "out/session.html"));
  if (seconds > 1000) {
    EXPECT_GT(minute_mib, 0);
    EXPECT_LT(end_mib, 1.01 * minute_mib);
  }
}

}  // namespace
}  // namespace limn::apps
