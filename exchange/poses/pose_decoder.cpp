#include "exchange/poses/pose_decoder.h"

#include <string_view>

#include "exchange/poses/free_d.h"
#include "exchange/poses/pose_json.h"
#include "exchange/poses/pose_limits.h"
#include "exchange/poses/posi_stage_net.h"

namespace limn::exchange {

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
  }
  LIMN_CHECK(false);
}

}  // namespace limn::exchange
