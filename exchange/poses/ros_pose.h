#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/foreign_pose.h"
#include "core/result.h"

namespace limn::exchange {

/// A pose as a message of ROS 2 states it, unchecked: geometry_msgs/PoseStamped, or a
/// geometry_msgs/TransformStamped of a tf2_msgs/TFMessage. Right-handed, metres.
struct RosPose {
  std::string frame;   ///< header.frame_id
  std::string sensor;  ///< the topic of a PoseStamped, the child frame of a transform
  std::int32_t s = 0;  ///< header.stamp, on the clock of the sender; with ns == 0 too: not stated
  std::uint32_t ns = 0;
  std::array<double, 3> position_m = {};
  std::array<double, 4> rotation_xyzw = {0, 0, 0, 1};
  bool is_static = false;  ///< a transform of `/tf_static`, which holds until another one comes
};

/// The checked pose. Error: no frame, one that is longer than 255 bytes, unprintable or the sensor itself; a
/// stamp of 1e9 nanoseconds or more; rotation_of()'s and check_position()'s.
Result<ForeignPose> pose_of_ros(const RosPose& pose);

/// The pose as a message. `at_ns`: its moment, in nanoseconds since 1970.
RosPose ros_pose(const ForeignPose& pose,
                 const std::string& frame,
                 const std::string& sensor,
                 std::int64_t at_ns);

/// The names as they may stand in a topic, in the same order: letters, digits and single "_", a letter first.
/// Where two become equal, the later one gets a number.
std::vector<std::string> ros_names(std::span<const std::string> names);

/// Error: not an absolute name of a topic such as /mocap/wand, or one of static transforms, which come with
/// those of the topic beside it.
Status check_ros_topic(std::string_view topic);

/// Whether a topic carries transforms (its last part is "tf") and not one pose.
constexpr bool has_transforms(std::string_view topic) { return topic.substr(topic.rfind('/') + 1) == "tf"; }
/// The topic of the static transforms beside a topic of transforms: /tf_static beside /tf.
inline std::string static_topic(const std::string& topic) { return topic + "_static"; }

}  // namespace limn::exchange
