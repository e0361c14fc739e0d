#include "exchange/poses/ros_frames.h"

#include <algorithm>
#include <iterator>

#include "exchange/poses/pose_limits.h"

namespace limn::exchange {
namespace {

constexpr std::size_t k_most_frames = 1024, k_most_samples = 512, k_longest_chain = 64;
constexpr double k_memory_s = 10;  // as tf2's buffer
constexpr double k_set_back_s = 1;

std::string joined(const std::vector<std::string>& frames) {
  std::string out;
  for (const std::string& frame : frames) out += (out.empty() ? "" : ", ") + printable_name(frame);
  return out;
}

}  // namespace

Status RosFrames::add(const RosPose& transform) {
  LIMN_TRY(const ForeignPose pose, pose_of_ros(transform));
  if (links_.size() >= k_most_frames && !links_.contains(transform.sensor))
    return error("ROS 2: expected at most {} frames in the transforms, found more. Use a topic with fewer.",
                 k_most_frames);
  Link& link = links_[transform.sensor];
  if (link.parent != transform.frame) link = {transform.frame, {}, {}, 0};
  link.change = ++changes_;
  if (transform.is_static || !pose.time_s) {
    link.fixed = pose.feed_from_sensor;
    link.samples.clear();
    return {};
  }
  if (!link.samples.empty() && *pose.time_s < link.samples.back().time_s - k_set_back_s)
    std::erase_if(links_, [&](const auto& each) {
      return !each.second.samples.empty() && each.first != transform.sensor;
    });
  add_sample({*pose.time_s, pose.feed_from_sensor}, &link.samples);
  return {};
}

void RosFrames::add_sample(const Sample& sample, std::deque<Sample>* to) {
  if (!to->empty() && sample.time_s < to->back().time_s - k_set_back_s) to->clear();
  const auto after = std::ranges::lower_bound(*to, sample.time_s, {}, &Sample::time_s);
  if (after != to->end() && after->time_s == sample.time_s)
    *after = sample;
  else
    to->insert(after, sample);
  while (to->size() > k_most_samples || to->front().time_s < to->back().time_s - k_memory_s) to->pop_front();
}

Result<std::vector<std::string>> RosFrames::way_up(const std::string& frame) const {
  std::vector<std::string> way = {frame};
  for (auto link = links_.find(frame); link != links_.end(); link = links_.find(way.back())) {
    const bool is_loop = std::ranges::find(way, link->second.parent) != way.end();
    way.push_back(link->second.parent);
    if (is_loop)
      return error(
          "ROS 2: expected frames that form a tree, found a loop in the transforms: {} (each is the parent "
          "of "
          "the one before). Find out which program publishes one of them (ros2 run tf2_tools view_frames).",
          joined(way));
    if (way.size() > k_longest_chain)
      return error("ROS 2: frame '{}': expected at most {} frames above it, found more.",
                   printable_name(frame), k_longest_chain);
  }
  return way;
}

Result<Pose> RosFrames::at(const std::string& frame, const Link& link, std::optional<double> time_s) {
  if (link.samples.empty()) return link.fixed;
  LIMN_CHECK(time_s);
  const auto after = std::ranges::lower_bound(link.samples, *time_s, {}, &Sample::time_s);
  LIMN_CHECK(after != link.samples.end());
  if (after->time_s == *time_s) return after->parent_from_frame;
  if (after == link.samples.begin())
    return error(
        "ROS 2: expected the transform of frame '{}' at {:.3f} s, up to which the others of its chain are "
        "known, found that it is known since {:.3f} s. Synchronise the clocks of the programs that publish "
        "transforms.",
        printable_name(frame), *time_s, link.samples.front().time_s);
  const auto before = std::prev(after);
  return interpolated(before->parent_from_frame, after->parent_from_frame,
                      (*time_s - before->time_s) / (after->time_s - before->time_s));
}

Result<RosFrames::Located> RosFrames::locate(const std::string& frame, const std::string& sensor) const {
  LIMN_TRY(const std::vector<std::string> from_sensor, way_up(sensor));
  LIMN_TRY(const std::vector<std::string> from_frame, way_up(frame));
  const auto common = std::ranges::find_first_of(from_sensor, from_frame);
  if (common == from_sensor.end())
    return error(
        "ROS 2: expected transforms between the frames '{}' and '{}', found a gap: none from '{}' to another "
        "frame, and none from '{}'. Publish what is missing (ros2 run tf2_tools view_frames shows the "
        "frames), or correct the name.",
        printable_name(frame), printable_name(sensor), printable_name(from_sensor.back()),
        printable_name(from_frame.back()));
  std::vector<std::string> below(from_sensor.begin(), common);
  const std::size_t sensor_steps = below.size();
  below.insert(below.end(), from_frame.begin(), std::ranges::find(from_frame, *common));

  Located out;
  for (const std::string& each : below) {
    const Link& link = links_.at(each);
    out.change = std::max(out.change, link.change);
    if (!link.samples.empty())
      out.time_s = std::min(out.time_s.value_or(link.samples.back().time_s), link.samples.back().time_s);
  }
  Pose common_from_sensor, common_from_frame;
  for (std::size_t i = 0; i < below.size(); ++i) {
    LIMN_TRY(const Pose parent_from_frame, at(below[i], links_.at(below[i]), out.time_s));
    Pose& chain = i < sensor_steps ? common_from_sensor : common_from_frame;
    chain = parent_from_frame * chain;
  }
  out.frame_from_sensor = common_from_frame.inverse() * common_from_sensor;
  return out;
}

}  // namespace limn::exchange
