#include "wizard/capture/capture_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "calib/capture.h"
#include "core/config.h"
#include "core/file.h"
#include "core/json_text.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* k_taken_by = "plan.json";  // beside capture.json

// The first value that differs between two plans, as text: "plan.board: captured with …, this plan says …";
// empty if none differs.
std::string difference(const nlohmann::json& then, const nlohmann::json& now) {
  const auto leaves_then = then.flatten(), leaves_now = now.flatten();
  std::set<std::string> keys;
  for (const auto* leaves : {&leaves_then, &leaves_now})
    for (const auto& leaf : leaves->items()) keys.insert(leaf.key());
  const auto field_text = [](const nlohmann::json& leaves, const std::string& key) {
    return leaves.contains(key) ? json_text(leaves[key]) : std::string("nothing");
  };
  for (const std::string& key : keys) {
    if (field_text(leaves_then, key) == field_text(leaves_now, key)) continue;
    std::string name = key.substr(1);
    std::replace(name.begin(), name.end(), '/', '.');
    return fmt::format("{}: captured with {}, this plan says {}", name, field_text(leaves_then, key),
                       field_text(leaves_now, key));
  }
  return "";
}

// The plan `now` without the poses that it has got at its end since `then`.
nlohmann::json beginning(nlohmann::json now, const nlohmann::json& then) {
  const nlohmann::json::json_pointer poses("/plan/world_from_board");
  if (!now.contains(poses) || !then.contains(poses)) return now;
  auto& list = now[poses];
  const std::size_t count = then[poses].size();
  if (list.size() > count) list.erase(list.begin() + static_cast<std::ptrdiff_t>(count), list.end());
  return now;
}

std::vector<fs::path> all_of(const calib::CapturedPose& pose) {
  std::vector<fs::path> files;
  for (const auto& of_projector : pose.images)
    for (const auto& of_camera : of_projector) files.insert(files.end(), of_camera.begin(), of_camera.end());
  return files;
}

}  // namespace

Result<std::string> captured_plan(const fs::path& plan_path, const fs::path& world_path) {
  ordered_json all = {{"schema", "limn.captured_plan/1"}};
  for (const auto& [name, path] : {std::pair("plan", plan_path), std::pair("world", world_path)}) {
    LIMN_TRY(const std::string text, read_file(path));
    all[name] = ordered_json::parse(text, nullptr, true, true);
  }
  all["plan"].erase("world");
  return json_text(all, 2) + "\n";
}

std::string captured_plan(const std::string& board,
                          calib::PatternCode code,
                          const calib::CaptureSet& captures) {
  ordered_json all = {{"schema", "limn.captured_plan/1"},
                      {"plan", {{"board", board}, {"code", calib::to_text(code)}}}};
  for (const auto* devices : {&captures.cameras, &captures.projectors})
    for (const calib::CapturedDevice& device : *devices)
      all["devices"][device.name] = {device.width, device.height};
  return json_text(all, 2) + "\n";
}

Status open_captures(const calib::CaptureSet& captures, const std::string& plan_json) {
  const fs::path taken_by = captures.folder / k_taken_by, begun = captures.folder / "capture.json";
  if (fs::exists(begun)) {
    if (!fs::exists(taken_by))
      return error(
          "{}: expected captures of limn calibrate, found other captures (no {}). Choose another --out.",
          captures.folder.string(), k_taken_by);
    LIMN_TRY(const Config config, Config::load(taken_by, "limn.captured_plan/1"));
    const nlohmann::json then = config.root().json();
    const std::string differs = difference(then, beginning(nlohmann::json::parse(plan_json), then));
    if (!differs.empty())
      return error(
          "{}: expected captures of this plan, found those of another plan: {}. Choose another --out, or "
          "calibrate with the plan of these captures.",
          captures.folder.string(), differs);
  }
  LIMN_TRY_STATUS(make_folder(captures.folder));
  LIMN_TRY_STATUS(write_file(taken_by, plan_json));
  return fs::exists(begun) ? Status() : calib::begin_captures(captures);
}

calib::CapturedPose files_of(const calib::CaptureSet& captures, int pose) {
  calib::CapturedPose files{fmt::format("pose{:02d}", pose), {}};
  for (std::size_t projector = 0; projector < captures.projectors.size(); ++projector) {
    auto& of_projector = files.images.emplace_back(captures.cameras.size());
    for (std::size_t camera = 0; camera < captures.cameras.size(); ++camera) {
      for (int i = 0; i < captures.patterns[projector].count(); ++i)
        of_projector[camera].push_back(
            calib::image_path(captures, pose, static_cast<int>(projector), static_cast<int>(camera), i));
    }
  }
  return files;
}

bool is_complete(const calib::CapturedPose& pose) {
  const auto files = all_of(pose);
  return std::all_of(files.begin(), files.end(), [](const fs::path& file) {
    std::error_code absent;
    const auto size = fs::file_size(file, absent);
    return !absent && size > 0;
  });
}

void remove_images(const calib::CapturedPose& pose) {
  for (const fs::path& file : all_of(pose)) {
    std::error_code absent;
    fs::remove(file, absent);
  }
}

}  // namespace limn::wizard
