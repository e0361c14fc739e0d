#pragma once

#include <span>

#include "core/foreign_pose.h"
#include "core/frame.h"
#include "core/result.h"
#include "exchange/poses/ros_port.h"
#include "session/session_client.h"

namespace limn::nodes {

/// Publishes poses in ROS 2: each that is not lost as a PoseStamped on /limn/poses/NAME, and all of them as a
/// TFMessage on /tf, in the frame limn_world, with the children limn/NAME. `at`: the present time on the
/// clock of the poses' time_s; the messages have ROS 2's, seconds since 1970. Error: the middleware's.
Status publish_poses(std::span<const ForeignPose> poses, Stamp at, exchange::RosPort* port);

/// Does so at each frame with the poses of the bodies and of the viewer. A failure is logged once.
class RosSender final : public session::SessionClient {
 public:
  explicit RosSender(exchange::RosPort* port) : port_(port) {}

  void apply_edits(const session::SessionMoment&) override {}
  void publish_state(const session::SessionMoment& moment) override;

 private:
  exchange::RosPort* port_;
  bool has_failed_ = false;
};

}  // namespace limn::nodes
