#include "device/devices_file.h"

#include <algorithm>
#include <optional>

#include "core/config.h"
#include "core/json_text.h"
#include "core/names.h"

namespace limn::device {
namespace {

namespace fs = std::filesystem;

constexpr const char* k_schema = "limn.devices/1";

std::optional<double> positive_of(const ConfigNode& node, const std::string& key) {
  const auto found = node.find(key);
  if (!found) return std::nullopt;
  return found->positive();
}

cv::Size size_of(const ConfigNode& node) {
  const auto found = node.find("size");
  if (!found) return {};
  const auto [width, height] = found->image_size();
  return {width, height};
}

// Paths are relative to the devices file; addresses stay unchanged.
std::string source_of(const ConfigNode& node, const fs::path& folder) {
  const std::string source = node.text();
  const std::size_t colon = source.find(':');
  if (source.empty()) node.problem("expected a camera's source, found an empty text.");
  if (colon != std::string::npos && source.find('/') > colon) return source;
  return (folder / source).lexically_normal().string();
}

device::CameraConfig read_camera(const ConfigNode& node, const fs::path& folder) {
  node.only({"name", "host", "source", "size", "exposure_ms", "gain", "white_balance_k", "sees"});
  device::CameraConfig camera;
  camera.name = node.at("name").text();
  if (const auto host = node.find("host")) camera.host = host->text();
  // Paths at another machine are relative to its own folder.
  camera.source = source_of(node.at("source"), camera.host.empty() ? folder : fs::path());
  camera.size = size_of(node);
  camera.sensor.exposure_ms = positive_of(node, "exposure_ms");
  if (const auto gain = node.find("gain")) camera.sensor.gain = gain->number();
  if (const auto sees = node.find("sees")) camera.sees = k_spectra.read(*sees);
  camera.sensor.white_balance_k = positive_of(node, "white_balance_k");
  return camera;
}

Wall wall_of(const ConfigNode& node) {
  const auto corners = node.items();
  Wall wall;
  if (corners.size() != 3) {
    node.problem(fmt::format(
        "expected the top left, top right and bottom left corner as [x, y, z] in mm, found {} corners.",
        corners.size()));
    return wall;
  }
  Eigen::Vector3d* const places[] = {&wall.top_left, &wall.top_right, &wall.bottom_left};
  for (std::size_t i = 0; i < 3; ++i) *places[i] = 1e-3 * corners[i].vector3();
  if (const Status is_wall = check_wall(wall); !is_wall) node.problem(is_wall.message());
  return wall;
}

device::DisplayConfig read_display(const ConfigNode& node) {
  node.only({"name", "host", "monitor", "size", "latency_ms", "stereo", "wall_mm"});
  device::DisplayConfig display;
  display.name = node.at("name").text();
  if (const auto host = node.find("host")) display.host = host->text();
  const std::string monitor = node.at("monitor").text();
  display.kind = device::k_display_kinds.find(monitor).value_or(device::DisplayKind::monitor);
  if (display.kind == device::DisplayKind::monitor) display.monitor = monitor;
  display.size = size_of(node);
  if (const auto latency = node.find("latency_ms")) {
    display.latency_s = latency->number() / 1000;
    if (display.latency_s < 0) latency->problem("expected a number >= 0.");
  }
  if (const auto stereo = node.find("stereo")) display.stereo = k_stereo_layouts.read(*stereo);
  if (const auto wall = node.find("wall_mm")) display.wall = wall_of(*wall);
  return display;
}

std::string source_with_host(const CameraConfig& camera) {
  return camera.host.empty() ? camera.source : camera.source + " at " + camera.host;
}

// Records a problem at the second of two items with the same `key`.
template <class Item, class Key>
void refuse_twins(const std::vector<Item>& items,
                  const std::vector<ConfigNode>& nodes,
                  const Key& key,
                  const char* what) {
  for (std::size_t i = 0; i < items.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (key(items[i]) == key(items[j]))
        nodes[i].problem(
            fmt::format("expected a {} of its own, found {}, which {} already has. Change one of them.", what,
                        key(items[i]), items[j].name));
}

Result<Devices> read_devices(const Config& config, const fs::path& folder) {
  const ConfigNode root = config.root();
  root.only({"schema", "cameras", "displays", "keys"});
  Devices devices;
  const auto cameras = root.at("cameras").items(), displays = root.at("displays").items();
  for (const ConfigNode& node : cameras) devices.cameras.push_back(read_camera(node, folder));
  for (const ConfigNode& node : displays) devices.displays.push_back(read_display(node));
  if (const auto keys = root.find("keys"))
    for (const ConfigNode& node : keys->items()) {
      node.only({"name", "path"});
      devices.keys.push_back({node.at("name").text(), folder / node.at("path").text()});
    }
  const auto name = [](const auto& item) { return item.name; };
  refuse_twins(devices.cameras, cameras, name, "name");
  refuse_twins(devices.displays, displays, name, "name");
  refuse_twins(devices.cameras, cameras, source_with_host, "source");
  for (std::size_t i = 0; i < displays.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const device::DisplayConfig &display = devices.displays[i], &other = devices.displays[j];
      if (display.kind == device::DisplayKind::monitor && display.monitor == other.monitor &&
          display.host == other.host)
        displays[i].problem(fmt::format("expected a monitor of its own, found {}, which {} already has.",
                                        display.monitor, other.name));
    }
  LIMN_TRY_STATUS(config.status());
  return devices;
}

nlohmann::ordered_json size_json(cv::Size size) { return {size.width, size.height}; }

nlohmann::ordered_json to_json(const CameraConfig& camera) {
  nlohmann::ordered_json json = {{"name", camera.name}, {"source", camera.source}};
  if (!camera.host.empty()) json["host"] = camera.host;
  if (!camera.size.empty()) json["size"] = size_json(camera.size);
  const SensorSettings& sensor = camera.sensor;
  if (sensor.exposure_ms) json["exposure_ms"] = *sensor.exposure_ms;
  if (sensor.gain) json["gain"] = *sensor.gain;
  if (sensor.white_balance_k) json["white_balance_k"] = *sensor.white_balance_k;
  json["sees"] = k_spectra.text(camera.sees);
  return json;
}

nlohmann::ordered_json to_json(const DisplayConfig& display) {
  nlohmann::ordered_json json = {{"name", display.name}, {"monitor", to_text(display)}};
  if (!display.host.empty()) json["host"] = display.host;
  if (!display.size.empty()) json["size"] = size_json(display.size);
  json["latency_ms"] = 1e3 * display.latency_s;
  json["stereo"] = k_stereo_layouts.text(display.stereo);
  return json;
}

Error size_differs(const Devices& devices, const std::string& name, cv::Size found, const Imager& imager) {
  return error(
      "{}: {}: expected the rig's size {}x{}, found {}x{}. Calibrate it at this size, or use the rig's size.",
      devices.file.string(), name, imager.width, imager.height, found.width, found.height);
}

// Each imager of the rig must be among the devices.
template <class Item>
Status all_there(const Devices& devices,
                 const std::vector<Item>& items,
                 const std::vector<Imager>& imagers,
                 const char* key) {
  for (const Imager& imager : imagers)
    if (!find_named(items, imager.name))
      return error(
          "{}: {}: expected the rig's {} among them, found no device of that name. Add it, or use the rig of "
          "these devices.",
          devices.file.string(), key, imager.name);
  return {};
}

}  // namespace

Result<Devices> load_devices(const fs::path& path) {
  LIMN_TRY(const Config config, Config::load(path, k_schema));
  LIMN_TRY(Devices devices, read_devices(config, config.folder()));
  devices.file = path;
  return devices;
}

Result<Devices> parse_devices(const std::string& text, const std::string& from, const fs::path& folder) {
  LIMN_TRY(const Config config, Config::parse(text, from, k_schema));
  return read_devices(config, folder);
}

std::string devices_text(std::span<const CameraConfig> cameras, std::span<const DisplayConfig> displays) {
  nlohmann::ordered_json json = {{"schema", k_schema},
                                 {"cameras", nlohmann::ordered_json::array()},
                                 {"displays", nlohmann::ordered_json::array()}};
  for (const CameraConfig& camera : cameras) json["cameras"].push_back(to_json(camera));
  for (const DisplayConfig& display : displays) json["displays"].push_back(to_json(display));
  return json_text(json);
}

Result<Devices> matched(const Devices& devices, const Rig& rig) {
  LIMN_TRY_STATUS(all_there(devices, devices.cameras, rig.cameras, "cameras"));
  LIMN_TRY_STATUS(all_there(devices, devices.displays, rig.projectors, "displays"));
  Devices fitted = devices;
  for (device::CameraConfig& camera : fitted.cameras) {
    const Imager* imager = find_named(rig.cameras, camera.name);
    if (!imager)
      return error(
          "{}: cameras: expected those of the rig ({}), found {}. Rename it, or calibrate it with the "
          "others.",
          devices.file.string(), joined_names(rig.cameras), camera.name);
    const cv::Size size(imager->width, imager->height);
    if (!camera.size.empty() && camera.size != size)
      return size_differs(devices, camera.name, camera.size, *imager);
    camera.size = size;
  }
  for (device::DisplayConfig& display : fitted.displays) {
    const Imager* imager = find_named(rig.projectors, display.name);
    if (!imager) continue;
    if (display.wall)
      return error(
          "{}: {}: expected wall_mm at a screen only, found it at a projector of the rig, whose place is in "
          "the "
          "rig. Remove wall_mm.",
          devices.file.string(), display.name);
    const cv::Size size(imager->width, imager->height);
    if (!display.size.empty() && display.size != size)
      return size_differs(devices, display.name, display.size, *imager);
    display.size = size;
  }
  return fitted;
}

}  // namespace limn::device
