#include "scene/volumes/readers/volume_check.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace limn::scene {
namespace {

// A window around 98 % of the values: single bright voxels must not darken the rest.
GreyWindow usual_window(const Volume& volume) {
  constexpr double k_left_out = 0.01;              // share of the values at each end
  constexpr std::size_t k_most_samples = 1 << 20;  // enough for a percentile
  const std::size_t step = std::max<std::size_t>(1, volume.values.size() / k_most_samples);
  std::vector<float> some;
  for (std::size_t i = 0; i < volume.values.size(); i += step) some.push_back(volume.values[i]);
  const auto at = [&](double share) {
    const auto nth = some.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(some.size() - 1));
    std::nth_element(some.begin(), nth, some.end());
    return static_cast<double>(*nth);
  };
  double low = at(k_left_out), high = at(1 - k_left_out);
  if (!(high > low)) low = static_cast<double>(volume.least), high = static_cast<double>(volume.most);
  return {(low + high) / 2, high > low ? high - low : 1};
}

}  // namespace

Eigen::Affine3d part_from_ras_mm() { return Eigen::Affine3d(Eigen::Scaling(1e-3)); }

Eigen::Affine3d part_from_lps_mm() { return Eigen::Affine3d(Eigen::Scaling(-1e-3, -1e-3, 1e-3)); }

Status check_volume_size(const std::string& where, const std::array<long, 3>& size) {
  double count = 1;
  for (const long along : size) {
    if (along < 2 || along > k_most_voxels_along)
      return error("{}: expected a volume of 2 to {} voxels along each axis, found {} x {} x {}. {}", where,
                   k_most_voxels_along, size[0], size[1], size[2],
                   along < 2 ? "Give a volume, not a single slice." : "Resample or crop it.");
    count *= static_cast<double>(along);
  }
  if (count > static_cast<double>(k_most_voxels))
    return error(
        "{}: expected at most {} million voxels, found {:.0f} million ({} x {} x {}). Resample or crop the "
        "volume.",
        where, k_most_voxels / 1'000'000, 1e-6 * count, size[0], size[1], size[2]);
  return {};
}

Status check_grid(const std::string& where, const Eigen::Affine3d& part_from_voxel) {
  if (!part_from_voxel.matrix().allFinite())
    return error("{}: expected finite numbers for the voxels' places, found others. Export the volume again.",
                 where);
  constexpr double k_least_side_m = 1e-9, k_most_side_m = 1;  // molecules … buildings
  constexpr double k_least_angle = 0.02;  // sine between an axis and the plane of the others
  const Eigen::Matrix3d axes = part_from_voxel.linear();
  const Eigen::Vector3d sides = axes.colwise().norm();
  if (!(sides.minCoeff() >= k_least_side_m && sides.maxCoeff() <= k_most_side_m))
    return error(
        "{}: expected voxels with sides of 1e-6 to 1000 mm, found {:.3g} x {:.3g} x {:.3g} mm. Check the "
        "file's spacing and unit.",
        where, 1e3 * sides.x(), 1e3 * sides.y(), 1e3 * sides.z());
  if (!(std::abs(axes.determinant()) >= k_least_angle * sides.prod()))
    return error(
        "{}: expected the grid's three axes in three different directions, found them in one plane. Export "
        "the volume again with its orientation.",
        where);
  return {};
}

Status complete_values(const std::string& where, GreyWindow stated, Volume* volume) {
  for (const float value : volume->values)
    if (!std::isfinite(value))
      return error("{}: expected finite values, found others after rescaling. Export the volume again.",
                   where);
  const auto [least, most] = std::minmax_element(volume->values.begin(), volume->values.end());
  volume->least = *least;
  volume->most = *most;
  const bool is_stated = std::isfinite(stated.level) && std::isfinite(stated.width) && stated.width > 0;
  volume->window = is_stated ? stated : usual_window(*volume);
  return {};
}

}  // namespace limn::scene
