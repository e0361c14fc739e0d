#include "exchange/poses/pose_decoder.h"

#include <string_view>

#include "exchange/poses/free_d.h"
#include "exchange/poses/pose_json.h"
#include "exchange/poses/pose_limits.h"
#include "exchange/poses/posi_stage_net.h"

namespace limn::exchange {

PoseDecoderOptions read_decoder_options(const ConfigNode& tracker) {
  PoseDecoderOptions out;
  out.protocol = k_pose_protocols.read(tracker.at("protocol"));
  if (out.protocol == PoseProtocol::ros) {
    const ConfigNode receive = tracker.at("receive");
    out.topic = receive.text();
    if (const Status checked = check_ros_topic(out.topic); !checked) receive.problem(checked.message());
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
  if (options.protocol != PoseProtocol::ros || has_transforms(options.topic) || sensor == options.topic)
    return {};
  return error("expected the topic '{}' as the only sensor, because it carries one pose, found '{}'.",
               options.topic, sensor);
}

Result<std::vector<ForeignPose>> PoseDecoder::decoded(std::span<const RosPose> message) {
  if (message.size() > k_most_poses)
    return error("ROS 2: expected at most {} poses in a message, found more.", k_most_poses);
  std::vector<ForeignPose> poses;
  std::optional<std::string> frame = frame_;
  for (const RosPose& each : message) {
    if (!options_.sensors.contains(each.sensor)) continue;
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
