#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "device/ros_image.h"
#include "nodes/ros_port.h"

namespace limn::nodes {

/// What is published in ROS 2's domain, as far as an image topic is concerned.
struct RosPublishers {
  std::size_t count = 0;                       ///< How many publish images on the topic.
  std::string other_type = {};                 ///< "std_msgs/String": the topic has no images; else empty.
  std::vector<std::string> image_topics = {};  ///< All topics with images, in order.
};

/// The images of one topic of ROS 2. Use it on one thread.
class RosImageFeed {
 public:
  virtual ~RosImageFeed() = default;

  /// header.stamp, and when the last part of the image arrived.
  struct Times {
    std::int32_t s = 0;
    std::uint32_t ns = 0;
    Stamp arrived_at;
  };
  using Use = std::function<void(const device::RosImage& image, const Times& times)>;

  /// Calls `use` with the newest image that it was not called with before; waits for one. False: none came
  /// until then.
  virtual bool next(Stamp until, const Use& use) = 0;
  virtual RosPublishers publishers() = 0;
};

/// Enters ROS 2's network as open_ros_port() does and receives a topic. Its type, sensor_msgs/Image or
/// sensor_msgs/CompressedImage, is that of the first publisher. Error: as open_ros_port().
Result<std::unique_ptr<RosImageFeed>> open_ros_images(const std::string& topic);

/// The function that the shared library exports. Null: it failed, and `problem` says why.
using OpenRosImages = RosImageFeed*(const RosNetwork& network,
                                    const std::string& topic,
                                    std::string* problem);
inline constexpr const char* k_open_ros_images = "limn_open_ros_images";

}  // namespace limn::nodes
