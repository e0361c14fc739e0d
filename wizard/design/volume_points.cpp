#include "wizard/design/volume_points.h"

namespace limn::design {
namespace {

constexpr int k_grid = 9;  // points along each side of the volume

}  // namespace

std::vector<Eigen::Vector3d> volume_points(const DescribedRig& described) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < k_grid * k_grid * k_grid; ++i) {
    const Eigen::Vector3d share(i % k_grid, i / k_grid % k_grid, i / (k_grid * k_grid));
    points.push_back(described.p_centre +
                     (share / (k_grid - 1) - Eigen::Vector3d::Constant(0.5)).cwiseProduct(described.size_m));
  }
  return points;
}

}  // namespace limn::design
