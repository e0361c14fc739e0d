#include "exchange/poses/pose_limits.h"

#include <algorithm>
#include <cmath>

#include "core/config.h"
#include "core/utf8.h"

namespace limn::exchange {

Result<Eigen::Quaterniond> rotation_of(double w, double x, double y, double z, const std::string& what) {
  const Eigen::Quaterniond q(w, x, y, z);
  const double length = q.norm();
  if (!(length >= 0.5 && length <= 2))
    return error("{}: expected a quaternion w, x, y, z of length 1, found length {}.", what, length);
  return q.normalized();
}

Status check_position(const Eigen::Vector3d& p_m, const std::string& what) {
  if (p_m.allFinite() && p_m.cwiseAbs().maxCoeff() <= k_largest_coordinate) return {};
  return error("{}: expected coordinates of at most {} m, found {}, {}, {}.", what, k_largest_coordinate,
               p_m.x(), p_m.y(), p_m.z());
}

std::string printable_name(const std::string& name) {
  constexpr std::size_t k_longest = 60;
  const auto is_control = [](unsigned char byte) { return byte < 0x20 || byte == 0x7f; };
  if (!is_utf8(name) || std::any_of(name.begin(), name.end(), is_control)) return "?";
  return as_utf8(name.substr(0, k_longest));
}

// M R M with M = diag(1, 1, -1): the rotation about the mirrored axis, the other way round.
Pose mirrored(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& p = pose.translation;
  return {Eigen::Quaterniond(q.w(), -q.x(), -q.y(), q.z()), Eigen::Vector3d(p.x(), p.y(), -p.z())};
}

}  // namespace limn::exchange
