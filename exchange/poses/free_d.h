#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/foreign_pose.h"
#include "core/result.h"

namespace limn::exchange {

/// FreeD's message D1 (Vinten Radamec, "free-d installation manual", appendices A and B): the pose of a
/// studio camera in 29 bytes. The frame of the room: x and y horizontal, z up. The sensor's frame: x right, y
/// forward, z up; at pan 0 it looks along the room's y. Pan is positive to the right, tilt upwards, roll
/// clockwise as seen from behind: feed_from_sensor = Rz(-pan) Rx(tilt) Ry(roll).
constexpr std::size_t k_free_d_bytes = 29;

/// Decodes a D1 message; the sensor's name is the camera's number. Error: another length or type, a wrong
/// checksum, angles beyond 180 degrees.
Result<ForeignPose> pose_of_free_d(std::span<const std::uint8_t> datagram);

/// Encodes a D1 message; zoom and focus are 0. The position is rounded to 1/64 mm, angles to 1/32768 degree.
/// Error: a position beyond 131 m, which the form cannot hold.
Result<std::vector<std::uint8_t>> free_d_message(int camera, const Pose& room_from_sensor);

}  // namespace limn::exchange
