#pragma once

#include <memory>
#include <string>

#include "core/result.h"
#include "exchange/poses/ros_port.h"

namespace limn::nodes {

/// How ROS 2's programs on this machine find each other.
struct RosNetwork {
  int domain = 0;              ///< ROS_DOMAIN_ID
  bool is_local_only = false;  ///< ROS_LOCALHOST_ONLY, ROS_AUTOMATIC_DISCOVERY_RANGE
};
/// Reads it from the environment. Error: ROS_DOMAIN_ID is no number from 0 to 232, or
/// ROS_AUTOMATIC_DISCOVERY_RANGE is OFF.
Result<RosNetwork> ros_network();

/// Enters ROS 2's network, without DDS Security. Cyclone DDS's own settings (CYCLONEDDS_URI) apply. Error:
/// engine_function()'s, ros_network()'s, or no network.
Result<std::unique_ptr<exchange::RosPort>> open_ros_port();

/// The function that the shared library exports. Null: it failed, and `problem` says why.
using OpenRosPort = exchange::RosPort*(const RosNetwork& network, std::string* problem);
inline constexpr const char* k_open_ros_port = "limn_open_ros_port";

}  // namespace limn::nodes
