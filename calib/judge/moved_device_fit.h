#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "calib/judge/rig_check.h"
#include "calib/measurement_model.h"
#include "calib/observations.h"
#include "core/imager.h"
#include "core/pose.h"

/// The fit that check_rig() runs for each hypothesis: where are all devices and boards if this device has
/// moved?
namespace limn::calib {

inline ImagerView view_of(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

/// Devices in the observations' order; a device is identified by its index: cameras first, then projectors.
struct RigCheckPlaces {
  std::vector<Imager> devices;
  size_t cameras = 0;
  std::vector<std::optional<Pose>> world_from_board;
  /// Inverse depths of the tie points, 1/m along z of their cameras; 0: not used.
  std::vector<double> inverse_depths;
  Eigen::Vector2d bend = Eigen::Vector2d::Zero();

  const Imager& camera(int i) const { return devices[static_cast<size_t>(i)]; }
  const Imager& projector(int i) const { return devices[cameras + static_cast<size_t>(i)]; }
  size_t device_of(const TiePointObservation& tie_observation) const {
    return static_cast<size_t>(tie_observation.imager) + (tie_observation.by_projector ? cameras : 0);
  }
};

/// Calls visit(index of the point, its observations) for every tie point that is observed.
template <typename Visit>
void each_point(const Observations& observations, const Visit& visit) {
  const std::vector<TiePointObservation>& all = observations.tie_observations;
  for (size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    while (end < all.size() && all[end].point == all[begin].point) ++end;
    visit(static_cast<size_t>(all[begin].point), std::span(all).subspan(begin, end - begin));
  }
}

/// The free parameters of a hypothesis: one device or none, and the boards that may have moved.
struct MoveHypothesis {
  static constexpr size_t k_nobody = static_cast<size_t>(-1);
  size_t device = k_nobody;
  std::vector<bool> boards;
};

struct MovedDeviceFit {
  RigCheckPlaces places;
  double misfit = std::numeric_limits<double>::infinity();  ///< chi squared of the independent samples
  Matrix6d covariance = Matrix6d::Zero();                   ///< covariance of the free device's pose
  bool determined = false;
};

/// Fits the free parameters of the hypothesis to all observations, starting from `places`; lenses are kept.
MovedDeviceFit fit_moved_device(const Observations& observations,
                                const RigCheckOptions& options,
                                const MoveHypothesis& free,
                                const RigCheckPlaces& places);

}  // namespace limn::calib
