#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/config.h"
#include "core/enum_names.h"
#include "core/foreign_pose.h"
#include "core/result.h"
#include "exchange/poses/pose_osc.h"
#include "exchange/poses/ros_frames.h"
#include "exchange/poses/ros_pose.h"

namespace limn::exchange {

/// How another tracking system sends its poses.
enum class PoseProtocol { osc, psn, freed, json, ros };
inline constexpr EnumNames<PoseProtocol, 5> k_pose_protocols{{"osc", "psn", "freed", "json", "ros"}};

struct PoseDecoderOptions {
  PoseProtocol protocol = PoseProtocol::json;
  PoseOscOptions osc;
  std::string topic = {};  ///< The topic of ROS 2.
  std::string frame = {};  ///< The frame of ROS 2 that transforms are followed up to; empty: they are not.
  bool is_left_handed = false;    ///< The sender's frame is; PosiStageNet's own always counts as such.
  std::set<std::string> sensors;  ///< Poses of others are left out. A name or, for PosiStageNet, a number.
};

/// Reads those keys of a tracker in a file limn.trackers/1 that say how its poses are written: protocol,
/// left_handed, unit, quaternion; for ROS 2 also receive, which is the topic, and frame. Records problems at
/// the node.
PoseDecoderOptions read_decoder_options(const ConfigNode& tracker);

/// Error: a topic of ROS 2 with one pose cannot have this sensor, or the sensor is the frame itself.
Status check_sensor(const PoseDecoderOptions& options, const std::string& sensor);

/// Decodes the datagrams or messages of one system. It remembers the names that PosiStageNet sends once a
/// second, and the frame of the first message or the transforms of ROS 2.
class PoseDecoder {
 public:
  explicit PoseDecoder(PoseDecoderOptions options) : options_(std::move(options)) {}

  /// The poses of the wanted sensors, under the names by which they are wanted. Error: see the codecs.
  Result<std::vector<ForeignPose>> decoded(std::span<const std::uint8_t> datagram);
  /// The same of a message of ROS 2. Error: pose_of_ros()'s, too many poses, or another frame than before.
  /// Where transforms are followed: the sensors whose chain has changed, and only too many are an error.
  Result<std::vector<ForeignPose>> decoded(std::span<const RosPose> message);
  /// What is wrong with the transforms since the last call: one that was refused, or a chain to a sensor that
  /// had a gap or loop in many messages. Empty: nothing.
  std::string take_problem() { return std::exchange(problem_, {}); }

 private:
  // What was decoded last of a sensor whose transforms are followed.
  struct Followed {
    std::optional<double> time_s;
    std::uint64_t change = 0;
    int failures = 0;  // in a row
  };
  Result<std::vector<ForeignPose>> all_poses(std::span<const std::uint8_t> datagram);
  std::vector<ForeignPose> followed(std::span<const RosPose> message);

  PoseDecoderOptions options_;
  std::map<std::string, std::string> names_;  // by number
  std::optional<std::string> frame_;          // that of ROS 2's poses
  RosFrames frames_;
  std::map<std::string, Followed> followed_;  // by sensor
  std::string problem_;
};

}  // namespace limn::exchange
