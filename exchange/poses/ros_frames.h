#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"
#include "exchange/poses/ros_pose.h"

namespace limn::exchange {

/// The tree of frames that the transforms of ROS 2 (`/tf` and `/tf_static`) span, with what each moving one
/// was lately: a small tf2 buffer. A transform is fixed if it comes from `/tf_static` or has no stamp; the
/// newest one counts for all times.
class RosFrames {
 public:
  /// A frame as seen from another one.
  struct Located {
    Pose frame_from_sensor;
    /// The newest moment at which all moving transforms of the chain are known, on the senders' clock;
    /// nullopt: none of them moves.
    std::optional<double> time_s;
    std::uint64_t change = 0;  ///< increases whenever a transform of the chain came
  };

  /// Adds a transform. A frame that gets another parent forgets the old one. A stamp that is older than the
  /// last one of its frame by more than a second counts as a clock that was set back: what is known of moving
  /// transforms is forgotten. Error: pose_of_ros()'s, or too many frames.
  Status add(const RosPose& transform);

  /// Follows the transforms from `sensor` and from `frame` up to the frame that both have in common. Each
  /// moving one is interpolated at Located::time_s. Error: the chain has a gap or a loop, or a transform of
  /// it is not known yet at the moment up to which the others are known.
  Result<Located> locate(const std::string& frame, const std::string& sensor) const;

 private:
  struct Sample {
    double time_s = 0;
    Pose parent_from_frame;
  };
  struct Link {
    std::string parent;
    Pose fixed;                  // parent_from_frame, if there are no samples
    std::deque<Sample> samples;  // oldest first
    std::uint64_t change = 0;
  };
  // A frame and those above it; the last one has no parent.
  Result<std::vector<std::string>> way_up(const std::string& frame) const;
  static void add_sample(const Sample& sample, std::deque<Sample>* to);
  static Result<Pose> at(const std::string& frame, const Link& link, std::optional<double> time_s);

  std::map<std::string, Link> links_;  // by the frame below
  std::uint64_t changes_ = 0;
};

}  // namespace limn::exchange
