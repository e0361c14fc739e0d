#include "exchange/poses/ros_pose.h"

#include <algorithm>
#include <set>

#include "exchange/poses/pose_limits.h"

namespace limn::exchange {
namespace {

constexpr std::size_t k_longest_frame = 255;
constexpr std::size_t k_longest_topic = 240;  // rmw's RMW_TOPIC_MAX_NAME_LENGTH is 247
constexpr std::uint32_t k_ns_per_s = 1'000'000'000;

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

Status check_frame(const std::string& frame, const char* key, const std::string& what) {
  if (!frame.empty() && frame.size() <= k_longest_frame && (frame == "?" || printable_name(frame) != "?"))
    return {};
  return error("{}: {}: expected the name of a frame, of at most {} bytes, found {}.", what, key,
               k_longest_frame,
               frame.empty() ? "none" : fmt::format("{} bytes '{}'", frame.size(), printable_name(frame)));
}

std::string ros_name(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const bool is_allowed = is_letter(c) || is_digit(c);
    if (is_allowed || !out.ends_with('_')) out += is_allowed ? c : '_';
  }
  if (!out.empty() && is_letter(out.front())) return out;
  return (out.starts_with('_') ? "body" : "body_") + out;
}

}  // namespace

Result<ForeignPose> pose_of_ros(const RosPose& pose) {
  const std::string what = fmt::format("ROS 2 pose of '{}'", printable_name(pose.sensor));
  LIMN_TRY_STATUS(check_frame(pose.frame, "frame_id", what));
  LIMN_TRY_STATUS(check_frame(pose.sensor, "child_frame_id", what));
  if (pose.frame == pose.sensor)
    return error("{}: expected a pose in another frame, found one in its own.", what);
  if (pose.ns >= k_ns_per_s)
    return error("{}: stamp: expected less than {} nanoseconds, found {}.", what, k_ns_per_s, pose.ns);
  ForeignPose out{pose.sensor, {}};
  out.feed_from_sensor.translation = {pose.position_m[0], pose.position_m[1], pose.position_m[2]};
  LIMN_TRY_STATUS(check_position(out.feed_from_sensor.translation, what));
  const auto& [x, y, z, w] = pose.rotation_xyzw;
  LIMN_TRY(out.feed_from_sensor.rotation, rotation_of(w, x, y, z, what));
  if (pose.s != 0 || pose.ns != 0) out.time_s = pose.s + 1e-9 * pose.ns;
  return out;
}

RosPose ros_pose(const ForeignPose& pose,
                 const std::string& frame,
                 const std::string& sensor,
                 std::int64_t at_ns) {
  const Eigen::Vector3d& p = pose.feed_from_sensor.translation;
  const Eigen::Quaterniond& q = pose.feed_from_sensor.rotation;
  return {frame,
          sensor,
          static_cast<std::int32_t>(at_ns / k_ns_per_s),
          static_cast<std::uint32_t>(at_ns % k_ns_per_s),
          {p.x(), p.y(), p.z()},
          {q.x(), q.y(), q.z(), q.w()}};
}

std::vector<std::string> ros_names(std::span<const std::string> names) {
  std::vector<std::string> out;
  std::set<std::string> taken;
  for (const std::string& name : names) {
    const std::string wanted = ros_name(name);
    std::string free = wanted;
    for (int i = 2; !taken.insert(free).second; ++i) free = fmt::format("{}_{}", wanted, i);
    out.push_back(free);
  }
  return out;
}

Status check_ros_topic(std::string_view topic) {
  bool is_topic = topic.starts_with('/') && !topic.ends_with('/') && topic.size() <= k_longest_topic;
  for (std::size_t i = 1; i < topic.size(); ++i) {
    const char c = topic[i];
    const bool is_first = topic[i - 1] == '/';
    is_topic &= is_letter(c) || c == '_' || (is_first ? false : is_digit(c) || c == '/');
  }
  if (topic.ends_with("/tf_static"))
    return error("expected a topic such as /tf, with which that of the static transforms comes, found '{}'.",
                 printable_name(std::string(topic)));
  if (is_topic) return {};
  return error("expected the absolute name of a topic of ROS 2 such as /mocap/wand or /tf, found '{}'.",
               printable_name(std::string(topic)));
}

}  // namespace limn::exchange
