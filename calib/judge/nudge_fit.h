#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "calib/judge/recheck.h"
#include "calib/observations.h"
#include "calib/predict.h"
#include "core/imager.h"
#include "core/pose.h"

/// What recheck() asks again and again: where would everything be, had this device moved?
namespace limn::calib {

inline ImagerView view_of(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

/// Devices in the observations' order; a device is named by its place: cameras first, then projectors.
struct RecheckPlaces {
  std::vector<Imager> devices;
  size_t cameras = 0;
  std::vector<std::optional<Pose>> world_from_board;
  std::vector<double> inverse_depths;  ///< of the free points, 1/m along z of their cameras; 0: none follows
  Eigen::Vector2d bend = Eigen::Vector2d::Zero();

  const Imager& camera(int i) const { return devices[static_cast<size_t>(i)]; }
  const Imager& projector(int i) const { return devices[cameras + static_cast<size_t>(i)]; }
  size_t device_of(const Sighting& sighting) const {
    return static_cast<size_t>(sighting.imager) + (sighting.by_projector ? cameras : 0);
  }
};

/// Calls visit(point's number, its sightings) with every free point that is sighted.
template <typename Visit>
void each_point(const Observations& observations, const Visit& visit) {
  const std::vector<Sighting>& all = observations.sightings;
  for (size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    while (end < all.size() && all[end].point == all[begin].point) ++end;
    visit(static_cast<size_t>(all[begin].point), std::span(all).subspan(begin, end - begin));
  }
}

/// What a hypothesis leaves free: one device or nobody, and the boards that are not known to stand still.
struct NudgeHypothesis {
  static constexpr size_t k_nobody = static_cast<size_t>(-1);
  size_t device = k_nobody;
  std::vector<bool> boards;
};

struct NudgeFit {
  RecheckPlaces places;
  double misfit = std::numeric_limits<double>::infinity();  ///< chi squared of the independent samples
  Matrix6d covariance = Matrix6d::Zero();                   ///< of the free device's pose
  bool determined = false;
};

/// Fits what the hypothesis leaves free, from `places` on, to all that is seen; lenses are kept.
NudgeFit fitted(const Observations& observations,
                const RecheckOptions& options,
                const NudgeHypothesis& free,
                const RecheckPlaces& places);

}  // namespace limn::calib
