#include "exchange/poses/pose_json.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "core/json_text.h"
#include "exchange/poses/pose_limits.h"

namespace limn::exchange {
namespace {

using Json = nlohmann::json;

constexpr int k_deepest = 5;  // array, object, poses, pose, position
constexpr double k_per_degree = std::numbers::pi / 180;
constexpr double k_largest_time_s = 1e12;

// nullopt: the key is absent.
Result<std::optional<double>> number_in(const Json& object,
                                        const char* key,
                                        double most,
                                        const std::string& what) {
  const auto found = object.find(key);
  if (found == object.end()) return std::optional<double>();
  const double value = found->is_number() ? found->get<double>() : std::nan("");
  if (!(std::abs(value) <= most))
    return error("{}: {}: expected a number of at most {}, found {}.", what, key, most,
                 json_text(*found).substr(0, 60));
  return std::optional(value);
}

Result<std::vector<double>> numbers_in(const Json& object,
                                       const char* key,
                                       std::size_t count,
                                       const std::string& what) {
  const auto found = object.find(key);
  std::vector<double> numbers;
  if (found != object.end() && found->is_array() && found->size() == count)
    for (const Json& item : *found)
      if (item.is_number()) numbers.push_back(item.get<double>());
  if (numbers.size() == count) return numbers;
  return error("{}: {}: expected {} numbers, found {}.", what, key, count,
               found == object.end() ? "none" : json_text(*found).substr(0, 60));
}

Result<std::string> name_in(const Json& pose) {
  const auto name = pose.is_object() ? pose.find("name") : pose.end();
  if (!pose.is_object() || name == pose.end() || !name->is_string() || name->get<std::string>().empty())
    return error("JSON poses: expected a pose with a name, found {}.", json_text(pose).substr(0, 60));
  return name->get<std::string>();
}

Result<ForeignPose> read_pose(const Json& json, std::optional<double> time_s) {
  ForeignPose pose;
  LIMN_TRY(pose.sensor, name_in(json));
  const std::string what = "JSON poses: " + printable_name(pose.sensor);
  pose.time_s = time_s;
  if (const auto lost = json.find("lost"); lost != json.end()) {
    if (!lost->is_boolean()) return error("{}: lost: expected true or false.", what);
    pose.is_lost = lost->get<bool>();
  }
  if (pose.is_lost) return pose;
  LIMN_TRY(const std::vector<double> p, numbers_in(json, "position_m", 3, what));
  pose.feed_from_sensor.translation = {p[0], p[1], p[2]};
  LIMN_TRY_STATUS(check_position(pose.feed_from_sensor.translation, what));
  pose.has_rotation = json.contains("rotation_wxyz");
  if (pose.has_rotation) {
    LIMN_TRY(const std::vector<double> q, numbers_in(json, "rotation_wxyz", 4, what));
    LIMN_TRY(pose.feed_from_sensor.rotation, rotation_of(q[0], q[1], q[2], q[3], what));
  }
  LIMN_TRY(pose.stddev_m, number_in(json, "stddev_mm", 1e6, what));
  LIMN_TRY(pose.stddev_rad, number_in(json, "stddev_deg", 360, what));
  if ((pose.stddev_m && *pose.stddev_m <= 0) || (pose.stddev_rad && *pose.stddev_rad <= 0))
    return error("{}: expected standard deviations over 0, found others.", what);
  if (pose.stddev_m) *pose.stddev_m *= 1e-3;
  if (pose.stddev_rad) *pose.stddev_rad *= k_per_degree;
  return pose;
}

Status read_object(const Json& json, std::vector<ForeignPose>* out) {
  const auto poses = json.is_object() ? json.find("poses") : json.end();
  if (!json.is_object() || poses == json.end() || !poses->is_array())
    return error("JSON poses: expected an object with a list \"poses\", found {}.",
                 json_text(json).substr(0, 60));
  LIMN_TRY(const std::optional<double> time_s, number_in(json, "time_s", k_largest_time_s, "JSON poses"));
  for (const Json& item : *poses) {
    if (out->size() == k_most_poses)
      return error("JSON poses: expected at most {} poses in a datagram, found more.", k_most_poses);
    LIMN_TRY(ForeignPose pose, read_pose(item, time_s));
    out->push_back(std::move(pose));
  }
  return {};
}

}  // namespace

Result<std::vector<ForeignPose>> poses_of_json(std::string_view datagram) {
  if (datagram.size() > k_longest_poses)
    return error("JSON poses: expected a datagram of at most {} bytes, found {}.", k_longest_poses,
                 datagram.size());
  bool is_too_deep = false;
  const auto check_depth = [&](int depth, Json::parse_event_t, Json&) {
    is_too_deep |= depth > k_deepest;
    return !is_too_deep;
  };
  const Json json = Json::parse(datagram, check_depth, false);
  if (is_too_deep) return error("JSON poses: expected at most {} levels of brackets, found more.", k_deepest);
  if (json.is_discarded()) return error("JSON poses: expected JSON, found {} other bytes.", datagram.size());
  std::vector<ForeignPose> poses;
  if (!json.is_array()) {
    LIMN_TRY_STATUS(read_object(json, &poses));
    return poses;
  }
  for (const Json& item : json) LIMN_TRY_STATUS(read_object(item, &poses));
  return poses;
}

std::string json_of_poses(const std::string& tracker, std::span<const ForeignPose> poses) {
  nlohmann::ordered_json json = {{"tracker", tracker}};
  if (!poses.empty() && poses.front().time_s) json["time_s"] = *poses.front().time_s;
  json["poses"] = nlohmann::ordered_json::array();
  for (const ForeignPose& pose : poses) {
    nlohmann::ordered_json item = {{"name", pose.sensor}};
    const Eigen::Vector3d& p = pose.feed_from_sensor.translation;
    const Eigen::Quaterniond& q = pose.feed_from_sensor.rotation;
    if (pose.is_lost) item["lost"] = true;
    if (!pose.is_lost) item["position_m"] = {p.x(), p.y(), p.z()};
    if (!pose.is_lost && pose.has_rotation) item["rotation_wxyz"] = {q.w(), q.x(), q.y(), q.z()};
    if (!pose.is_lost && pose.stddev_m) item["stddev_mm"] = 1e3 * *pose.stddev_m;
    if (!pose.is_lost && pose.stddev_rad) item["stddev_deg"] = *pose.stddev_rad / k_per_degree;
    json["poses"].push_back(std::move(item));
  }
  return json_text(json);
}

}  // namespace limn::exchange
