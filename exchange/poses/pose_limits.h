#pragma once

#include "core/foreign_pose.h"
#include "core/result.h"

namespace limn::exchange {

/// Longer datagrams of poses are refused; bytes. It is the longest frame of networks with large frames.
constexpr std::size_t k_longest_poses = 9000;
/// More poses in one datagram are refused.
constexpr std::size_t k_most_poses = 256;

/// A rotation from four numbers. Lengths from 0.5 to 2 are normalised. Error (it begins with `what`): a
/// number that is not finite, or another length.
Result<Eigen::Quaterniond> rotation_of(double w, double x, double y, double z, const std::string& what);

/// Error (it begins with `what`): a coordinate that is not finite or beyond core's k_largest_coordinate.
Status check_position(const Eigen::Vector3d& p_m, const std::string& what);

/// The name as it may stand in a message to people: cut to 60 bytes; "?" where it is no printable UTF-8.
std::string printable_name(const std::string& name);

/// The pose in a frame of the other handedness, whose z axis points the other way; so is the sensor's own.
Pose mirrored(const Pose& pose);

}  // namespace limn::exchange
