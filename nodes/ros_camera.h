#pragma once

#include <memory>
#include <string>

#include "device/open_camera.h"
#include "nodes/ros_clock.h"
#include "nodes/ros_image_feed.h"

namespace limn::nodes {

/// A camera whose images come on a topic of ROS 2: sensor_msgs/Image or sensor_msgs/CompressedImage. The
/// newest image counts; older ones that were not read are lost. `captured_at` is the message's stamp, see
/// RosClock.
class RosCamera final : public device::CameraSource {
 public:
  /// Opens `ros:/TOPIC`. If the size is known, its publisher may come later; otherwise it waits for the first
  /// image, 5 s at most. Error: no name of a topic, settings that Limn cannot set, open_ros_images()'s, no
  /// image, or one that cannot be used.
  static Result<std::unique_ptr<RosCamera>> open(const device::CameraConfig& config);

  const std::string& name() const override { return config_.name; }
  cv::Size size() const override { return config_.size; }
  /// Images that cannot be used are left out within the limit; an error names the last one's fault, or what
  /// is published instead.
  Result<Frame> next() override;
  std::string description() const override;

 private:
  explicit RosCamera(const device::CameraConfig& config) : config_(config) {}
  Result<Frame> next_within(double limit_s);
  Result<Frame> frame_of(const device::RosImage& image, const RosImageFeed::Times& times);
  std::string why_none() const;

  device::CameraConfig config_;
  std::string topic_;
  std::unique_ptr<RosImageFeed> feed_;
  RosClock clock_;
  std::string fault_;  // why the last image could not be used
  bool is_compressed_ = false, has_warned_ = false;
  long images_ = 0, damaged_ = 0;
};

/// As device::open_camera(), and cameras of ROS 2 (`ros:/TOPIC`).
Result<std::unique_ptr<device::CameraSource>> open_camera_here(const device::CameraConfig& config);

}  // namespace limn::nodes
