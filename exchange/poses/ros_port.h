#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "exchange/poses/ros_pose.h"

namespace limn::exchange {

/// What a message of a topic holds: one pose, or the transforms of a TFMessage.
struct RosMessage {
  std::vector<RosPose> poses;
  Stamp arrived_at;
};

/// A participant of ROS 2, for poses only. nodes/ has the implementation, because only that room has DDS. The
/// functions never wait and may be called from different threads.
class RosPort {
 public:
  virtual ~RosPort() = default;

  /// Receives a topic (PoseStamped, or TFMessage where has_transforms()) from now on, and with one of
  /// transforms its static_topic(). The result names it in next(). Error: the middleware's.
  virtual Result<std::size_t> subscribe(const std::string& topic) = 0;
  /// The next message of a topic. Of those that wait, the oldest are lost beyond 128. nullopt: none waits.
  virtual std::optional<RosMessage> next(std::size_t subscription) = 0;

  /// Publishes a PoseStamped; `pose.sensor` is not sent. Error: the middleware's.
  virtual Status publish_pose(const std::string& topic, const RosPose& pose) = 0;
  /// Publishes a TFMessage.
  virtual Status publish_transforms(const std::string& topic, std::span<const RosPose> poses) = 0;
};

}  // namespace limn::exchange
