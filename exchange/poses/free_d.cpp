#include "exchange/poses/free_d.h"

#include <array>
#include <cmath>
#include <numbers>

namespace limn::exchange {
namespace {

using Eigen::Vector3d;

constexpr std::uint8_t k_type = 0xD1, k_sum_start = 0x40;
constexpr double k_per_degree = 32768, k_per_mm = 64, k_degrees = 180 / std::numbers::pi;
constexpr std::int32_t k_most = (1 << 23) - 1;

// Where the six signed numbers begin: pan, tilt, roll, x, y, z.
constexpr std::size_t k_first_number = 2;

std::uint8_t checksum(std::span<const std::uint8_t> bytes) {
  unsigned sum = k_sum_start;
  for (const std::uint8_t byte : bytes) sum -= byte;
  return static_cast<std::uint8_t>(sum);
}

// A signed number of 24 bits, the highest byte first.
std::int32_t number_at(std::span<const std::uint8_t> bytes, std::size_t index) {
  const std::size_t at = k_first_number + 3 * index;
  const std::int32_t value = bytes[at] << 16 | bytes[at + 1] << 8 | bytes[at + 2];
  return value > k_most ? value - (1 << 24) : value;
}

Eigen::Quaterniond turn(double angle_deg, const Vector3d& d_axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_deg / k_degrees, d_axis));
}

struct Angles {
  double pan_deg, tilt_deg, roll_deg;
};

// Looking straight up or down leaves only pan and roll together; roll is 0 then.
Angles angles_of(const Eigen::Quaterniond& rotation) {
  constexpr double k_straight_up = 1 - 1e-9;
  const Eigen::Matrix3d r = rotation.toRotationMatrix();
  const double tilt = std::asin(std::clamp(r(2, 1), -1.0, 1.0)) * k_degrees;
  if (std::abs(r(2, 1)) > k_straight_up) return {std::atan2(-r(1, 0), r(0, 0)) * k_degrees, tilt, 0};
  return {std::atan2(r(0, 1), r(1, 1)) * k_degrees, tilt, std::atan2(-r(2, 0), r(2, 2)) * k_degrees};
}

}  // namespace

Result<ForeignPose> pose_of_free_d(std::span<const std::uint8_t> datagram) {
  if (datagram.size() != k_free_d_bytes)
    return error("FreeD: expected a message of {} bytes, found {}.", k_free_d_bytes, datagram.size());
  if (datagram[0] != k_type)
    return error("FreeD: expected a message of type D1, found type {:02X}.", datagram[0]);
  if (const std::uint8_t sum = checksum(datagram.first(k_free_d_bytes - 1)); sum != datagram.back())
    return error("FreeD: camera {}: expected the checksum {:02X}, found {:02X}.", datagram[1], sum,
                 datagram.back());
  std::array<double, 3> angles_deg{};
  for (std::size_t i = 0; i < 3; ++i) {
    angles_deg[i] = number_at(datagram, i) / k_per_degree;
    if (std::abs(angles_deg[i]) > 180)
      return error("FreeD: camera {}: expected angles of at most 180 degrees, found {}.", datagram[1],
                   angles_deg[i]);
  }
  ForeignPose pose;
  pose.sensor = std::to_string(datagram[1]);
  pose.feed_from_sensor = Pose(
      turn(-angles_deg[0], Vector3d::UnitZ()) * turn(angles_deg[1], Vector3d::UnitX()) *
          turn(angles_deg[2], Vector3d::UnitY()),
      1e-3 / k_per_mm * Vector3d(number_at(datagram, 3), number_at(datagram, 4), number_at(datagram, 5)));
  return pose;
}

Result<std::vector<std::uint8_t>> free_d_message(int camera, const Pose& room_from_sensor) {
  if (camera < 0 || camera > 255) return error("FreeD: expected a camera from 0 to 255, found {}.", camera);
  if (!room_from_sensor.is_finite()) return error("FreeD: camera {}: expected a finite pose.", camera);
  const Angles angles = angles_of(room_from_sensor.rotation);
  const Vector3d p_mm = 1e3 * room_from_sensor.translation;
  std::vector<std::uint8_t> bytes = {k_type, static_cast<std::uint8_t>(camera)};
  for (const double value :
       {k_per_degree * angles.pan_deg, k_per_degree * angles.tilt_deg, k_per_degree * angles.roll_deg,
        k_per_mm * p_mm.x(), k_per_mm * p_mm.y(), k_per_mm * p_mm.z()}) {
    if (!(std::abs(value) <= k_most))
      return error("FreeD: camera {}: expected a position within 131 m, found {}, {}, {} m.", camera,
                   1e-3 * p_mm.x(), 1e-3 * p_mm.y(), 1e-3 * p_mm.z());
    const auto number = static_cast<std::uint32_t>(std::lround(value));
    for (const int shift : {16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(number >> shift));
  }
  bytes.resize(k_free_d_bytes - 1);
  bytes.push_back(checksum(bytes));
  return bytes;
}

}  // namespace limn::exchange
