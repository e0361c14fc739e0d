#include "calib/judge/fault_costs.h"

#include <algorithm>
#include <cmath>

#include "core/log.h"
#include "core/median.h"

namespace limn::calib {
namespace {

// Length on the boards that a pixel of camera 0 covers, mm: the median over the boards. 0: no board.
double mm_per_camera_px(const Observations& observations, const Solution& solution) {
  const Imager& camera = solution.rig.cameras.front();
  const Eigen::Vector3d p_centre(observations.board.width_m() / 2, observations.board.height_m() / 2, 0);
  std::vector<double> depths;
  for (const auto& world_from_board : solution.world_from_board) {
    if (world_from_board) depths.push_back((camera.imager_from_world * (*world_from_board * p_centre)).z());
  }
  return 1e3 * median(std::move(depths)) / camera.lens.fx();
}

}  // namespace

void state_costs(const Observations& observations,
                 const Solution& solution,
                 double predicted_mm,
                 std::vector<Fault>* faults) {
  const auto boards =
      std::count_if(solution.world_from_board.begin(), solution.world_from_board.end(),
                    [](const auto& world_from_board) { return world_from_board.has_value(); });
  if (boards == 0) return;
  const double mm_per_px = mm_per_camera_px(observations, solution) / std::sqrt(static_cast<double>(boards));
  for (Fault& fault : *faults) {
    if (fault.noise_factor > 1 && std::isfinite(predicted_mm))
      fault.evidence +=
          fmt::format("; in focus the predicted error would be about {:.2f} mm instead of {:.2f} mm",
                      predicted_mm / fault.noise_factor, predicted_mm);
    if (fault.taken_out_px > 0)
      fault.evidence +=
          fmt::format("; left in, it would cost about {:.3f} mm", fault.taken_out_px * mm_per_px);
  }
}

}  // namespace limn::calib
