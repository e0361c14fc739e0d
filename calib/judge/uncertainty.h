#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calib/cross_validation.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// A rigid target in the world, as points. One camera measures its pose from the pixels of these points: the
/// one that sees most of them; of several, the first.
using RigidTarget = std::vector<Eigen::Vector3d>;

/// Uncertainty of the rig. `covariance`: covariance of the devices' parameters, in the order of
/// Solution::covariance. `measured_px`: standard deviation of one coordinate of a target's points in camera
/// 0.
struct Uncertainty {
  Eigen::MatrixXd covariance;
  double measured_px = 0;
};

/// The devices' covariance by the jackknife: how far they move when one board pose at a time is left out
/// (Efron and Tibshirani, An Introduction to the Bootstrap, section 11). It includes errors that a whole pose
/// shares, which the residuals' scatter does not show: a board that bends, a capture that drifts, a lens
/// model that is not quite right. `without`: the devices as solved without one pose each; rigs whose lens
/// models differ from the solution's are skipped. Zero when fewer than 3 remain.
Eigen::MatrixXd jackknife_covariance(const Solution& solution, std::span<const Rig> without);

/// Covariance (m^2) of where a projector's light lands that is meant for points on a target, along two
/// directions of the surface at each point. The target's pose follows the camera's errors (linearised), so
/// that errors which camera and projector share cancel. A point that the projector does not reach has no
/// value; none has one when the camera sees fewer than 6 of the target's points, or only points on a line.
struct SurfaceTarget {
  Eigen::Vector3d p_world;
  Eigen::Vector3d n_world;  ///< unit normal of the surface
};
std::vector<std::optional<Eigen::Matrix2d>> light_covariances(const Solution& solution,
                                                              const Uncertainty& uncertainty,
                                                              const RigidTarget& thing,
                                                              size_t projector,
                                                              std::span<const SurfaceTarget> places);

/// The distance (m) that 95 % of the light stays within when it scatters around its targets by these
/// covariances; each group counts the same. Infinite when there is none.
double p95_of(std::span<const std::vector<Eigen::Matrix2d>> groups);

/// For each projector: 95 % error on the surface, mm, of points on a rigid target that fills its panel at the
/// boards' distance and whose pose camera 0 measures from 24 of its points: a third of the light with the
/// target in place, a third with it moved by 150 mm, a third with it turned by 40 degrees both ways. Where
/// other cameras see much of the panel that camera 0 does not, they measure targets there, which count as
/// much. Infinite when no camera sees what a projector reaches.
std::vector<double> propagated_error_mm(const Observations& observations,
                                        const Solution& solution,
                                        const Uncertainty& uncertainty);

/// The estimated uncertainty of a solution: its covariance (from the residuals' scatter) widened towards the
/// jackknife's, and never narrowed; it is widened by all that the jackknife shows beyond what independent
/// errors of the observations explain. `options`: those of the solution's covariance. `held_out`: the devices
/// as solved without one pose each; poses that differ from all others count less. Targets are assumed to be
/// measured as well as the board's corners were, but not better than markers are. Reasons and evidence:
/// docs/decisions/0004-the-stated-error.md.
Uncertainty estimated_uncertainty(const Observations& observations,
                                  const Solution& solution,
                                  const SolveOptions& options,
                                  const CrossValidation& held_out);

}  // namespace limn::calib
