#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/foreign_pose.h"
#include "core/result.h"
#include "device/udp_socket.h"
#include "exchange/poses/pose_decoder.h"
#include "session/session_client.h"

namespace limn::session {

/// Sends the poses of the bodies and of the viewer to other programs at each frame (docs/trackers.md), as
/// PosiStageNet, FreeD or JSON over UDP. The frame is the world; the moment is that of the light.
class PoseSender final : public SessionClient {
 public:
  /// `targets`: PROTOCOL:HOST:PORT each, with psn, freed or json. Error: names the option --poses-out.
  static Result<PoseSender> open(const std::vector<std::string>& targets);

  void apply_edits(const SessionMoment&) override {}
  void publish_state(const SessionMoment& moment) override;

 private:
  struct Target {
    exchange::PoseProtocol protocol;
    device::UdpSocket socket;
  };
  PoseSender() = default;
  void send_psn(device::UdpSocket* socket, const std::vector<ForeignPose>& poses, Stamp at, bool with_names);

  std::vector<Target> targets_;
  std::uint8_t frame_ = 0;
  std::optional<Stamp> named_at_;  // when names were last sent
};

/// The poses that are sent for a composed frame, in a fixed order: the scene's bodies, then "viewer", the
/// imager that `view` parts are drawn for (its frame: x right, y forward, z up, as that of a studio camera).
std::vector<ForeignPose> sent_poses(const scene::Scene& scene, const ComposedFrame& composed);

}  // namespace limn::session
