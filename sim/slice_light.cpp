#include "sim/slice_light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/photometric_response.h"

namespace limn::sim {

double value_at(const scene::Volume& volume, const Eigen::Vector3d& p_part) {
  const Eigen::Vector3d p_voxel = volume.part_from_voxel.inverse() * p_part;
  std::array<int, 3> near{};
  Eigen::Vector3d share;
  for (int axis = 0; axis < 3; ++axis) {
    const int last = volume.size[static_cast<std::size_t>(axis)] - 1;
    const double at = std::clamp(p_voxel[axis], 0.0, static_cast<double>(last));
    near[static_cast<std::size_t>(axis)] = std::min(static_cast<int>(at), last - 1);
    share[axis] = at - near[static_cast<std::size_t>(axis)];
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2 & 1;
    const double weight =
        (i ? share.x() : 1 - share.x()) * (j ? share.y() : 1 - share.y()) * (k ? share.z() : 1 - share.z());
    const std::size_t index =
        static_cast<std::size_t>(near[0] + i) +
        static_cast<std::size_t>(volume.size[0]) *
            (static_cast<std::size_t>(near[1] + j) +
             static_cast<std::size_t>(volume.size[1]) * static_cast<std::size_t>(near[2] + k));
    sum += weight * static_cast<double>(volume.values[index]);
  }
  return sum;
}

double slice_light(const scene::Volume& volume,
                   const scene::GreyWindow& window,
                   const Eigen::Vector3d& p_part) {
  const double grey = 0.5 + (value_at(volume, p_part) - window.level) / window.width;
  return linear_from_srgb(std::clamp(grey, 0.0, 1.0));
}

}  // namespace limn::sim
