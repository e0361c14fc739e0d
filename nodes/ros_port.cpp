#include "nodes/ros_port.h"

#include <charconv>
#include <cstdlib>
#include <string_view>

#include "nodes/engine_library.h"
#include "nodes/ros_image_feed.h"

namespace limn::nodes {
namespace {

constexpr int k_last_domain = 232;  // the last one whose ports exist (DDSI-RTPS 2.5, 9.6.2)

std::string_view variable(const char* name) {
  const char* text = std::getenv(name);
  return text ? text : "";
}

}  // namespace

Result<RosNetwork> ros_network() {
  RosNetwork out;
  // The older variable counts, as in ROS 2.
  const std::string_view range = variable("ROS_AUTOMATIC_DISCOVERY_RANGE");
  out.is_local_only = variable("ROS_LOCALHOST_ONLY") == "1" || range == "LOCALHOST";
  if (!out.is_local_only && range == "OFF")
    return error(
        "ROS_AUTOMATIC_DISCOVERY_RANGE: expected SUBNET or LOCALHOST, found OFF, with which no program finds "
        "another. Set it as for the other programs.");
  const std::string_view text = variable("ROS_DOMAIN_ID");
  if (text.empty()) return out;
  const char* end = text.data() + text.size();
  const auto [last, problem] = std::from_chars(text.data(), end, out.domain);
  if (problem == std::errc() && last == end && out.domain >= 0 && out.domain <= k_last_domain) return out;
  return error("ROS_DOMAIN_ID: expected a number from 0 to {}, found '{}'. Set it as for the other programs.",
               k_last_domain, text);
}

Result<std::unique_ptr<exchange::RosPort>> open_ros_port() {
  LIMN_TRY(const RosNetwork network, ros_network());
  LIMN_TRY(void* function, engine_function(k_open_ros_port));
  std::string problem;
  std::unique_ptr<exchange::RosPort> port(reinterpret_cast<OpenRosPort*>(function)(network, &problem));
  if (!port) return Error{problem};
  return port;
}

Result<std::unique_ptr<RosImageFeed>> open_ros_images(const std::string& topic) {
  LIMN_TRY(const RosNetwork network, ros_network());
  LIMN_TRY(void* function, engine_function(k_open_ros_images));
  std::string problem;
  std::unique_ptr<RosImageFeed> feed(reinterpret_cast<OpenRosImages*>(function)(network, topic, &problem));
  if (!feed) return Error{problem};
  return feed;
}

}  // namespace limn::nodes
