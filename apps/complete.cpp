#include "apps/complete.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/bench.h"
#include "core/file.h"
#include "core/predefined_family.h"
#include "core/user_folder.h"
#include "tracker/apriltag_codes.h"
#include "tracker/barcode.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

Words families() {
  Words names;
  for (const auto& family : predefined_families()) names.emplace_back(family.name);
  names.emplace_back("aruco_mip_36h12");
  for (const auto& family : tracker::apriltag3_families()) names.emplace_back(family);
  for (const auto& barcode : tracker::barcodes()) names.emplace_back(barcode.name);
  return names;
}

Words rooms() {
  Words names;
  const auto folder = user_folder();
  std::error_code ignored;
  if (folder)
    for (const auto& entry : fs::directory_iterator(*folder / "rooms", ignored))
      if (entry.is_directory(ignored)) names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

Json read_json(const fs::path& path) {
  const auto text = read_file(path);
  return text ? Json::parse(*text, nullptr, false, true) : Json();
}

std::string text_of(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

// The scene.json of the command line: --scene SCENE, or the scene of a world file.
fs::path scene_file(const Words& words) {
  std::error_code ignored;
  const auto file = [&](const fs::path& path) {
    return fs::is_directory(path, ignored) ? path / "scene.json" : path;
  };
  const auto option = std::ranges::find(words, "--scene");
  if (option != words.end() && option + 1 != words.end()) return file(*(option + 1));
  for (const std::string& word : words) {
    if (!word.ends_with(".json")) continue;
    const std::string scene = text_of(read_json(word), "scene");
    if (!scene.empty()) return file(fs::path(word).parent_path() / scene);
  }
  return {};
}

Words slots(const Words& words) {
  Words names;
  const Json scene = read_json(scene_file(words));
  const auto list = [](const Json& json, const char* key) {
    const auto found = json.is_object() ? json.find(key) : json.end();
    return found != json.end() && found->is_array() ? *found : Json::array();
  };
  for (const Json& slot : list(scene, "slots"))
    for (const Json& variant : list(slot, "variants"))
      names.push_back(text_of(slot, "name") + "=" + text_of(variant, "name"));
  return names;
}

}  // namespace

std::optional<Words> completion_list(const std::string& list, const Words& words) {
  if (list == "families") return families();
  if (list == "rooms") return rooms();
  if (list == "slots") return slots(words);
  if (list == "benches") {
    const auto names = bench_names();
    return Words(names.begin(), names.end());
  }
  return std::nullopt;
}

}  // namespace limn::apps
