#include "scene/marker_file.h"

#include <nlohmann/json.hpp>
#include <set>

#include "core/config.h"
#include "core/json_text.h"

namespace limn::scene {
namespace {

constexpr const char *k_body = "limn.body/1", *k_markers = "limn.markers/1";

}  // namespace

Result<std::vector<BodyMarker>> load_marker_file(const std::filesystem::path& path) {
  LIMN_TRY(const Config config, Config::load(path, ""));
  const ConfigNode root = config.root();
  const bool is_body = root.at("schema").choice({k_body, k_markers}) == k_body;
  std::vector<BodyMarker> markers;
  std::set<MarkerName> names;
  for (const ConfigNode& node : root.at("markers").items()) {
    const auto name = MarkerName::parse(node.at("name").text());
    if (!name) {
      node.at("name").problem(name.message());
      break;
    }
    if (!names.insert(*name).second)
      node.at("name").problem(fmt::format("expected each marker once, found {} twice.", name->text()));
    markers.push_back({*name, 1e-3 * node.at("size_mm").positive(k_largest_marker_mm),
                       node.at(is_body ? "body_from_marker" : "prototype_from_marker").pose()});
  }
  if (markers.empty()) root.at("markers").problem("expected at least one marker, found none.");
  LIMN_TRY_STATUS(config.status());
  return markers;
}

std::string marker_file_json(std::span<const BodyMarker> markers) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const BodyMarker& marker : markers)
    all.push_back({{"name", marker.marker.text()},
                   {"size_mm", 1e3 * marker.size_m},
                   {"prototype_from_marker", to_json(marker.body_from_marker)}});
  return json_text(nlohmann::ordered_json({{"schema", k_markers}, {"markers", all}}), 2) + "\n";
}

}  // namespace limn::scene
