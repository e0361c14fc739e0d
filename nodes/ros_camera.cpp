#include "nodes/ros_camera.h"

#include <algorithm>
#include <optional>

#include "core/log.h"
#include "core/names.h"
#include "exchange/poses/ros_pose.h"

namespace limn::nodes {
namespace {

constexpr std::string_view k_ros_source = "ros:";
constexpr double k_first_image_s = 5;  // programs in a network find each other in less

// Numbers of the domain for messages; open_ros_images() has checked it.
int ros_domain() {
  const auto network = ros_network();
  return network ? network->domain : 0;
}

}  // namespace

Result<std::unique_ptr<RosCamera>> RosCamera::open(const device::CameraConfig& config) {
  std::unique_ptr<RosCamera> out(new RosCamera(config));
  out->topic_ = config.source.substr(k_ros_source.size());
  if (const Status checked = exchange::check_ros_topic(out->topic_); !checked)
    return error("{} ({}): {} Write ros:/camera/image_raw.", config.name, config.source, checked.message());
  if (config.sensor.exposure_ms || config.sensor.gain || config.sensor.white_balance_k)
    return error(
        "{} ({}): expected no exposure_ms, gain or white_balance_k, because Limn cannot set them in ROS 2, "
        "found "
        "one. Set it at the camera's driver and remove the key.",
        config.name, config.source);
  LIMN_TRY(out->feed_, open_ros_images(out->topic_));
  const bool is_size_known = !config.size.empty();
  const auto first =
      out->next_within(is_size_known ? config.limit_s : std::max(config.limit_s, k_first_image_s));
  const bool may_come_later = is_size_known && out->damaged_ == 0;
  if (!first && !may_come_later) return first.error();
  if (first) out->config_.size = first->image.size();
  return out;
}

Result<Frame> RosCamera::next() { return next_within(config_.limit_s); }

Result<Frame> RosCamera::next_within(double limit_s) {
  const Stamp until = shifted(now(), limit_s);
  std::optional<Result<Frame>> frame;
  fault_.clear();
  while (feed_->next(
      until, [&](const device::RosImage& image, const auto& times) { frame = frame_of(image, times); })) {
    if (frame && *frame) return std::move(*frame);
    ++damaged_;
    fault_ = frame ? frame->message() : "its message could not be read.";
  }
  return error("{} ({}): expected an image within {:g} s, found none: {}", config_.name, config_.source,
               limit_s, why_none());
}

Result<Frame> RosCamera::frame_of(const device::RosImage& image, const RosImageFeed::Times& times) {
  LIMN_TRY(Frame frame, device::frame_of_ros(image, config_.grey));
  const cv::Size found = frame.image.size();
  if (!config_.size.empty() && found != config_.size)
    return error("expected {}x{}, found {}x{}. Set the camera to that size, or calibrate it at this one.",
                 config_.size.width, config_.size.height, found.width, found.height);
  frame.camera = config_.name;
  frame.captured_at = clock_.captured_at(times.s, times.ns, times.arrived_at, wall_at_zero_ns());
  if (!clock_.problem().empty() && !has_warned_)
    log_warning(
        "{} ({}): expected stamps of this machine's clock, found one that {}. Such images count as captured "
        "when "
        "they arrive. Synchronise both machines' clocks (chrony), or set the stamps at the camera's driver.",
        config_.name, config_.source, clock_.problem());
  has_warned_ = !clock_.problem().empty();
  is_compressed_ = image.is_compressed;
  ++images_;
  return frame;
}

std::string RosCamera::why_none() const {
  if (!fault_.empty()) return fault_;
  const RosPublishers there = feed_->publishers();
  if (there.count > 0)
    return fmt::format(
        "{} of it {} there, but no image arrived. Check that the camera runs (ros2 topic hz {}). If images "
        "are "
        "large, raise net.core.rmem_max, or use the topic of compressed images (docs/trackers.md).",
        there.count == 1 ? "a publisher" : fmt::format("{} publishers", there.count),
        there.count == 1 ? "is" : "are", topic_);
  const std::string found = there.other_type.empty()
                                ? "nobody publishes it"
                                : fmt::format("it carries {}, which is no image", there.other_type);
  constexpr std::size_t k_most_listed = 8;
  std::vector<std::string> topics = there.image_topics;
  if (topics.size() > k_most_listed) {
    topics.resize(k_most_listed);
    topics.emplace_back("and others");
  }
  return fmt::format(
      "{} in domain {}. Topics with images there: {}. Start the camera's driver, or correct the topic or "
      "ROS_DOMAIN_ID (ros2 topic list).",
      found, ros_domain(), joined_names(topics));
}

std::string RosCamera::description() const {
  return fmt::format(
      "ROS 2, {}, {}x{}; {} images, {} of no use; stamps: {}",
      is_compressed_ ? "sensor_msgs/CompressedImage" : "sensor_msgs/Image", config_.size.width,
      config_.size.height, images_, damaged_,
      clock_.problem().empty() ? "the sender's" : "one " + clock_.problem() + ", so the arrival's");
}

Result<std::unique_ptr<device::CameraSource>> open_camera_here(const device::CameraConfig& config) {
  if (!config.source.starts_with(k_ros_source)) return device::open_camera(config);
  LIMN_TRY(std::unique_ptr<device::CameraSource> camera, RosCamera::open(config));
  return camera;
}

}  // namespace limn::nodes
