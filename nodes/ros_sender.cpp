#include "nodes/ros_sender.h"

#include <chrono>
#include <cmath>

#include "core/log.h"
#include "session/pose_sender.h"

namespace limn::nodes {
namespace {

constexpr const char *k_frame = "limn_world", *k_poses = "/limn/poses/", *k_transforms = "/tf";

std::int64_t unix_ns() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_1970).count();
}

}  // namespace

Status publish_poses(std::span<const ForeignPose> poses, Stamp at, exchange::RosPort* port) {
  const std::int64_t now_ns = unix_ns();
  std::vector<std::string> names;
  for (const ForeignPose& pose : poses) names.push_back(pose.sensor);
  names = exchange::ros_names(names);
  std::vector<exchange::RosPose> transforms;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (poses[i].is_lost) continue;  // the messages have no word for it
    const double ahead_s = poses[i].time_s.value_or(seconds_of(at)) - seconds_of(at);
    transforms.push_back(
        exchange::ros_pose(poses[i], k_frame, "limn/" + names[i], now_ns + std::llround(1e9 * ahead_s)));
    LIMN_TRY_STATUS(port->publish_pose(k_poses + names[i], transforms.back()));
  }
  if (transforms.empty()) return {};
  return port->publish_transforms(k_transforms, transforms);
}

void RosSender::publish_state(const session::SessionMoment& moment) {
  if (!moment.shown) return;
  const auto poses = session::sent_poses(moment.session.setup().scene, moment.session.composed());
  const Status published = publish_poses(poses, moment.at, port_);
  if (!published && !has_failed_) log_warning("live: {}", published.message());
  has_failed_ |= !published;
}

}  // namespace limn::nodes
