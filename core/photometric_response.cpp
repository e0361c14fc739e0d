#include "core/photometric_response.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/config.h"
#include "core/file.h"
#include "core/image_formats.h"
#include "core/image_io.h"
#include "core/json_text.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

constexpr double k_map_unit = 1.0 / 4096;  // one level of a map: half the noise of 8-bit measurements
constexpr std::uint16_t k_no_value = 65535;

// ---- reading

void check_curve(const ConfigNode& node, const std::vector<double>& curve) {
  if (curve.size() < 2 || !std::is_sorted(curve.begin(), curve.end()))
    node.problem("expected curves of at least 2 numbers that never fall (from black to full light).");
}

std::optional<double> optional_number(const ConfigNode& node, const char* key) {
  const auto found = node.find(key);
  if (!found || found->json().is_null()) return std::nullopt;
  return found->number();
}

std::optional<Measurement> read_measured(const ConfigNode& node, const char* key) {
  const auto found = node.find(key);
  if (!found || found->json().is_null()) return std::nullopt;
  found->only({"value", "stddev"});
  return Measurement{found->at("value").number(), found->at("stddev").number()};
}

std::optional<Vignetting> read_vignetting(const ConfigNode& node) {
  const auto found = node.find("vignetting");
  if (!found || found->json().is_null()) return std::nullopt;
  found->only({"tilt", "r2", "r4", "corner_stddev"});
  Vignetting vignetting;
  const std::vector<double> tilt = found->at("tilt").numbers(2);
  if (tilt.size() == 2) vignetting.tilt = {tilt[0], tilt[1]};
  vignetting.r2 = found->at("r2").number();
  vignetting.r4 = found->at("r4").number();
  vignetting.corner_stddev = found->at("corner_stddev").number();
  return vignetting;
}

ProjectorResponse read_projector(const ConfigNode& node) {
  node.only({"name", "red", "green", "blue", "black_level", "vignetting", "white_over_sum", "worst_residual",
             "drift", "captures"});
  ProjectorResponse response{node.at("name").text(), node.at("red").numbers(-1), node.at("green").numbers(-1),
                             node.at("blue").numbers(-1)};
  for (const auto* curve : {&response.red, &response.green, &response.blue}) check_curve(node, *curve);
  response.black_level = read_measured(node, "black_level");
  response.vignetting = read_vignetting(node);
  response.white_over_sum = optional_number(node, "white_over_sum");
  response.worst_residual = optional_number(node, "worst_residual");
  response.drift = optional_number(node, "drift");
  if (const auto captures = node.find("captures")) response.captures = captures->integer();
  return response;
}

CameraResponse read_camera(const ConfigNode& node) {
  node.only({"name", "encoding", "gamma", "gamma_stddev", "pedestal", "light", "noise_dark", "noise_bright",
             "vignetting"});
  CameraResponse response;
  response.camera = node.at("name").text();
  response.encoding = k_camera_encodings.read(node.at("encoding"));
  response.gamma = node.at("gamma").positive();
  response.gamma_stddev = node.at("gamma_stddev").number();
  response.pedestal = node.at("pedestal").number();
  response.light = node.at("light").numbers(256);
  check_curve(node, response.light);
  response.noise_dark = node.at("noise_dark").number();
  response.noise_bright = node.at("noise_bright").number();
  response.vignetting = read_vignetting(node);
  return response;
}

Result<Config> load_config(const fs::path& path) {
  LIMN_TRY(Config config, Config::load(path, "limn.response/1"));
  config.root().only({"schema", "projectors", "cameras", "mixing", "provenance"});
  LIMN_TRY_STATUS(config.status());
  return config;
}

Result<cv::Mat> load_map(const fs::path& path, double unit, int width, int height) {
  LIMN_TRY(const std::string bytes, read_file(path));
  const auto image = image_formats::decode_png(bytes, false);
  const cv::Mat stored = image ? image->samples : cv::Mat();
  if (stored.depth() != CV_16U || stored.cols != width || stored.rows != height ||
      (stored.channels() != 1 && stored.channels() != 3))
    return error("{}: expected a 16-bit PNG of {}x{}, found something else. Run limn solve again.",
                 path.string(), width, height);
  cv::Mat map;
  stored.convertTo(map, CV_32F, unit);
  for (auto& value : cv::Mat_<float>(map.reshape(1)))
    if (value >= static_cast<float>(k_no_value * unit)) value = std::numeric_limits<float>::quiet_NaN();
  return map;
}

// ---- writing

// Seven digits: further ones are noise and differ between compilers.
double rounded(double value) { return std::round(value * 1e7) / 1e7; }

OrderedJson rounded(const std::vector<double>& values) {
  OrderedJson list = OrderedJson::array();
  for (const double value : values) list.push_back(rounded(value));
  return list;
}

OrderedJson json_of(const std::optional<double>& value) {
  return value ? OrderedJson(rounded(*value)) : OrderedJson();
}

OrderedJson json_of(const std::optional<Measurement>& measured) {
  if (!measured) return {};
  return {{"value", rounded(measured->value)}, {"stddev", rounded(measured->stddev)}};
}

OrderedJson json_of(const std::optional<Vignetting>& vignetting) {
  if (!vignetting) return {};
  return {{"tilt", {rounded(vignetting->tilt.x()), rounded(vignetting->tilt.y())}},
          {"r2", rounded(vignetting->r2)},
          {"r4", rounded(vignetting->r4)},
          {"corner_stddev", rounded(vignetting->corner_stddev)}};
}

OrderedJson json_of(const ProjectorResponse& response) {
  return {{"name", response.projector},
          {"red", rounded(response.red)},
          {"green", rounded(response.green)},
          {"blue", rounded(response.blue)},
          {"black_level", json_of(response.black_level)},
          {"vignetting", json_of(response.vignetting)},
          {"white_over_sum", json_of(response.white_over_sum)},
          {"worst_residual", json_of(response.worst_residual)},
          {"drift", json_of(response.drift)},
          {"captures", response.captures}};
}

OrderedJson json_of(const CameraResponse& response) {
  return {{"name", response.camera},
          {"encoding", k_camera_encodings.text(response.encoding)},
          {"gamma", rounded(response.gamma)},
          {"gamma_stddev", rounded(response.gamma_stddev)},
          {"pedestal", rounded(response.pedestal)},
          {"light", rounded(response.light)},
          {"noise_dark", rounded(response.noise_dark)},
          {"noise_bright", rounded(response.noise_bright)},
          {"vignetting", json_of(response.vignetting)}};
}

using Maps = std::array<std::pair<const char*, const cv::Mat*>, 4>;
Maps maps_of(const ColourMixing& mixing) {
  return {
      {{"red", &mixing.red}, {"green", &mixing.green}, {"blue", &mixing.blue}, {"offset", &mixing.offset}}};
}

std::string map_file(const ColourMixing& mixing, const char* map) {
  return fmt::format("response/{}-{}-{}.png", mixing.projector, mixing.camera, map);
}

OrderedJson json_of(const ColourMixing& mixing) {
  OrderedJson json = {{"projector", mixing.projector},
                      {"camera", mixing.camera},
                      {"size", {mixing.offset.cols, mixing.offset.rows}},
                      {"unit", k_map_unit}};
  for (const auto& [name, map] : maps_of(mixing)) json[name] = map_file(mixing, name);
  json["held_out_levels"] = rounded(mixing.held_out_levels);
  return json;
}

cv::Mat stored_map(const cv::Mat& map) {
  cv::Mat stored(map.size(), CV_MAKETYPE(CV_16U, map.channels()));
  const cv::Mat values = map.reshape(1);
  cv::Mat levels = stored.reshape(1);
  for (int r = 0; r < values.rows; ++r)
    for (int c = 0; c < values.cols; ++c) {
      const double level = std::round(values.at<float>(r, c) / k_map_unit);
      levels.at<std::uint16_t>(r, c) =
          std::isnan(level) ? k_no_value
                            : static_cast<std::uint16_t>(std::clamp(level, 0.0, k_no_value - 1.0));
    }
  return stored;
}

}  // namespace

double Vignetting::gain(const Eigen::Vector2d& px, int width, int height) const {
  const Eigen::Vector2d half(width / 2.0, height / 2.0);
  const Eigen::Vector2d q = (px - half + Eigen::Vector2d::Constant(0.5)) / half.norm();
  return 1 + tilt.dot(q) + r2 * q.squaredNorm() + r4 * q.squaredNorm() * q.squaredNorm();
}

Result<RigResponses> load_responses(const fs::path& response_json) {
  LIMN_TRY(const Config config, load_config(response_json));
  RigResponses responses;
  for (const ConfigNode& node : config.root().at("projectors").items())
    responses.projectors.push_back(read_projector(node));
  if (const auto cameras = config.root().find("cameras"))
    for (const ConfigNode& node : cameras->items()) responses.cameras.push_back(read_camera(node));
  LIMN_TRY_STATUS(config.status());
  return responses;
}

Status save_responses(const RigResponses& responses,
                      const std::vector<ColourMixing>& mixings,
                      const fs::path& folder) {
  OrderedJson json = {{"schema", "limn.response/1"},
                      {"projectors", OrderedJson::array()},
                      {"cameras", OrderedJson::array()},
                      {"mixing", OrderedJson::array()}};
  for (const ProjectorResponse& response : responses.projectors)
    json["projectors"].push_back(json_of(response));
  for (const CameraResponse& response : responses.cameras) json["cameras"].push_back(json_of(response));
  LIMN_TRY_STATUS(make_folder(mixings.empty() ? folder : folder / "response"));
  for (const ColourMixing& mixing : mixings) {
    json["mixing"].push_back(json_of(mixing));
    for (const auto& [name, map] : maps_of(mixing))
      LIMN_TRY_STATUS(write_png(folder / map_file(mixing, name), stored_map(*map)));
  }
  return write_file(folder / "response.json", json_text(json, 1) + "\n");
}

Result<ColourMixing> load_mixing(const fs::path& response_json,
                                 const std::string& projector,
                                 const std::string& camera) {
  LIMN_TRY(const Config config, load_config(response_json));
  const auto list = config.root().find("mixing");
  for (const ConfigNode& node : list ? list->items() : std::vector<ConfigNode>()) {
    if (node.at("projector").text() != projector || node.at("camera").text() != camera) continue;
    node.only({"projector", "camera", "size", "unit", "red", "green", "blue", "offset", "held_out_levels"});
    ColourMixing mixing{projector, camera, {}, {}, {}, {}, node.at("held_out_levels").number()};
    const auto [width, height] = node.at("size").image_size();
    const double unit = node.at("unit").positive();
    const std::array<std::pair<const char*, cv::Mat*>, 4> maps = {
        {{"red", &mixing.red}, {"green", &mixing.green}, {"blue", &mixing.blue}, {"offset", &mixing.offset}}};
    for (const auto& [name, map] : maps) {
      const fs::path path = node.at(name).path_inside();
      LIMN_TRY_STATUS(config.status());
      LIMN_TRY(*map, load_map(path, unit, width, height));
    }
    return mixing;
  }
  LIMN_TRY_STATUS(config.status());
  return error("{}: mixing: expected {} seen by {}, found no such entry. Capture response images of it.",
               response_json.string(), projector, camera);
}

double linear_from_srgb(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

double srgb_from_linear(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

double lookup(const std::vector<double>& table, double at) {
  const double place = std::clamp(at, 0.0, 1.0) * static_cast<double>(table.size() - 1);
  const std::size_t first = std::min(static_cast<std::size_t>(place), table.size() - 2);
  const double share = place - static_cast<double>(first);
  return (1 - share) * table[first] + share * table[first + 1];
}

double inverse_lookup(const std::vector<double>& table, double value) {
  const auto above = std::upper_bound(table.begin(), table.end(), value);
  if (above == table.begin()) return 0;
  if (above == table.end()) return 1;
  const double step = *above - *(above - 1);
  return (static_cast<double>(above - 1 - table.begin()) + (value - *(above - 1)) / step) /
         static_cast<double>(table.size() - 1);
}

}  // namespace limn
