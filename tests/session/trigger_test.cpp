// Measures the time from a person's trigger (a key, OSC, a button) to the first light that shows the change,
// on the virtual rig's clock. For real time with a software renderer, see limn bench live.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "apps/live.h"
#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct ShownVariant {
  double shown_at_s;
  std::string variant;
};

// The variants that a slot showed, frame by frame.
std::vector<ShownVariant> shown_variants(const fs::path& poses_csv, const std::string& slot) {
  std::ifstream file(poses_csv);
  std::vector<ShownVariant> shown;
  for (std::string line; std::getline(file, line);) {
    std::stringstream fields(line);
    std::string at, of, variant;
    std::getline(fields, at, ','), std::getline(fields, of, ','), std::getline(fields, variant, ',');
    if (of == slot) shown.push_back({std::stod(at), variant});
  }
  return shown;
}

TEST(Trigger, IsSeenWithinATenthOfASecond) {
  const fs::path folder = test::test_folder();
  constexpr int k_triggers = 40;
  std::vector<double> triggers_s;
  json events = json::array();
  for (int i = 0; i < k_triggers; ++i) {
    triggers_s.push_back(0.4 + 0.1013 * i);  // at different moments of the frame period
    events.push_back(
        {{"at_s", triggers_s.back()}, {"edit", {{"action", "next_variant"}, {"slot", "mirror"}}}});
  }
  const json script = {{"schema", "limn.script/1"}, {"seconds", triggers_s.back() + 0.3}, {"events", events}};
  ASSERT_TRUE(write_file(folder / "script.json", script.dump()));
  apps::LiveOptions options;
  options.resolution = 0.34;
  options.script = folder / "script.json";
  options.out = folder / "out";
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();

  const auto shown = shown_variants(folder / "out/poses.csv", "mirror");
  std::vector<double> changed_s;
  for (std::size_t i = 1; i < shown.size(); ++i)
    if (shown[i].variant != shown[i - 1].variant) changed_s.push_back(shown[i].shown_at_s);
  ASSERT_EQ(changed_s.size(), triggers_s.size());
  std::vector<double> waits_ms;
  for (std::size_t i = 0; i < changed_s.size(); ++i) waits_ms.push_back(1e3 * (changed_s[i] - triggers_s[i]));
  std::sort(waits_ms.begin(), waits_ms.end());
  std::printf("from a trigger to its first light: %.0f ms (median), %.0f ms at most\n",
              waits_ms[waits_ms.size() / 2], waits_ms.back());
  EXPECT_GT(waits_ms.front(), 0);
  EXPECT_LE(waits_ms.back(), 100);
}

}  // namespace
}  // namespace limn::session
