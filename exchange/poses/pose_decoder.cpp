#include "exchange/poses/pose_decoder.h"

#include <string_view>

#include "exchange/poses/free_d.h"
#include "exchange/poses/pose_json.h"
#include "exchange/poses/pose_limits.h"
#include "exchange/poses/posi_stage_net.h"

namespace limn::exchange {
namespace {

// Messages in which a chain of transforms may have a gap before it is reported: at the start the static ones
// may come later than the others.
constexpr int k_patient_messages = 20;

}  // namespace

PoseDecoderOptions read_decoder_options(const ConfigNode& tracker) {
  PoseDecoderOptions out;
  out.protocol = k_pose_protocols.read(tracker.at("protocol"));
  if (out.protocol == PoseProtocol::ros) {
    const ConfigNode receive = tracker.at("receive");
    out.topic = receive.text();
    if (const Status checked = check_ros_topic(out.topic); !checked) receive.problem(checked.message());
  }
  if (const auto frame = tracker.find("frame")) {
    out.frame = frame->text();
    if (!has_transforms(out.topic) || out.frame.empty())
      frame->problem("expected the name of a frame, and that the topic carries transforms (/tf).");
  }
  if (const auto left = tracker.find("left_handed")) out.is_left_handed = left->boolean();
  for (const char* key : {"unit", "quaternion"})
    if (const auto other = tracker.find(key); other && out.protocol != PoseProtocol::osc)
      other->problem("expected this key with the protocol osc only, found it with another.");
  if (const auto unit = tracker.find("unit")) out.osc.unit_m = unit->choice({"mm", "m"}) == "m" ? 1 : 1e-3;
  if (const auto order = tracker.find("quaternion"))
    out.osc.has_real_part_last = order->choice({"wxyz", "xyzw"}) == "xyzw";
  return out;
}

Status check_sensor(const PoseDecoderOptions& options, const std::string& sensor) {
  if (options.protocol != PoseProtocol::ros) return {};
  if (sensor == options.frame) return error("expected another frame than '{}' itself.", sensor);
  if (has_transforms(options.topic) || sensor == options.topic) return {};
  return error("expected the topic '{}' as the only sensor, because it carries one pose, found '{}'.",
               options.topic, sensor);
}

Result<std::vector<ForeignPose>> PoseDecoder::decoded(std::span<const RosPose> message) {
  if (message.size() > k_most_poses)
    return error("ROS 2: expected at most {} poses in a message, found more.", k_most_poses);
  if (!options_.frame.empty()) return followed(message);
  std::vector<ForeignPose> poses;
  std::optional<std::string> frame = frame_;
  for (const RosPose& each : message) {
    if (each.is_static || !options_.sensors.contains(each.sensor)) continue;
    LIMN_TRY(ForeignPose pose, pose_of_ros(each));
    if (!frame) frame = each.frame;
    if (*frame != each.frame)
      return error(
          "ROS 2 pose of '{}': frame_id: expected '{}', as before, found '{}'. Make one tracker for each "
          "frame, or start again.",
          printable_name(each.sensor), *frame, each.frame);
    if (options_.is_left_handed) pose.feed_from_sensor = mirrored(pose.feed_from_sensor);
    poses.push_back(std::move(pose));
  }
  frame_ = frame;
  return poses;
}

std::vector<ForeignPose> PoseDecoder::followed(std::span<const RosPose> message) {
  std::vector<ForeignPose> poses;
  for (const RosPose& transform : message)
    if (const Status added = frames_.add(transform); !added) problem_ = added.message();
  for (const std::string& sensor : options_.sensors) {
    Followed& before = followed_[sensor];
    const auto found = frames_.locate(options_.frame, sensor);
    before.failures = found ? 0 : before.failures + 1;
    if (before.failures > k_patient_messages) problem_ = found.message();
    if (!found || found->change == before.change || (found->time_s && found->time_s == before.time_s))
      continue;
    before = {found->time_s, found->change, 0};
    ForeignPose pose{sensor, found->frame_from_sensor};
    pose.time_s = found->time_s;
    if (options_.is_left_handed) pose.feed_from_sensor = mirrored(pose.feed_from_sensor);
    poses.push_back(std::move(pose));
  }
  return poses;
}

Result<std::vector<ForeignPose>> PoseDecoder::decoded(std::span<const std::uint8_t> datagram) {
  LIMN_TRY(std::vector<ForeignPose> poses, all_poses(datagram));
  std::erase_if(poses, [&](ForeignPose& pose) {
    const auto name = names_.find(pose.sensor);
    if (!options_.sensors.contains(pose.sensor) && name != names_.end()) pose.sensor = name->second;
    return !options_.sensors.contains(pose.sensor);
  });
  if (options_.is_left_handed && options_.protocol != PoseProtocol::psn)
    for (ForeignPose& pose : poses) pose.feed_from_sensor = mirrored(pose.feed_from_sensor);
  return poses;
}

Result<std::vector<ForeignPose>> PoseDecoder::all_poses(std::span<const std::uint8_t> datagram) {
  switch (options_.protocol) {
    case PoseProtocol::osc:
      return poses_of_osc(datagram, options_.osc);
    case PoseProtocol::json:
      return poses_of_json({reinterpret_cast<const char*>(datagram.data()), datagram.size()});
    case PoseProtocol::freed: {
      LIMN_TRY(const ForeignPose pose, pose_of_free_d(datagram));
      return std::vector{pose};
    }
    case PoseProtocol::psn: {
      LIMN_TRY(PsnPacket packet, psn_packet(datagram));
      for (const auto& [number, name] : packet.names) names_[std::to_string(number)] = name;
      return std::move(packet.poses);
    }
    case PoseProtocol::ros:
      return error("ROS 2: expected messages of its middleware, found a datagram.");
  }
  LIMN_CHECK(false);
}

}  // namespace limn::exchange
