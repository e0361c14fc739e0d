#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/surface/registration.h"
#include "calib/surface/surface_samples.h"
#include "core/enum_names.h"
#include "core/result.h"
#include "core/stage.h"

namespace limn::calib {

/// What is known at a point of the CAD.
enum class DeviationState : std::uint8_t {
  measured,
  uncertain,     ///< Measured, but twice its standard deviation is larger than the tolerance.
  beyond_reach,  ///< The scan's nearest surface along the normal is further than the reach: something else
                 ///< hides the point, or the prototype lacks it.
  not_measured   ///< The scan has no surface there.
};
inline constexpr EnumNames<DeviationState, 4> k_deviation_states{
    {"measured", "uncertain", "beyond_reach", "not_measured"}};
inline std::string to_text(DeviationState state) { return k_deviation_states.text(state); }

struct DeviationOptions {
  double tolerance_m = 0.5e-3;
  /// Surfaces further from the CAD along its normal are something else, such as a hand. A larger value finds
  /// larger deviations, and takes more of what lies on the prototype for it.
  double reach_m = 5e-3;
  double spacing_m = 0;                ///< Distance of the CAD's points; 0: that of the scan's points.
  std::size_t most_samples = 300'000;  ///< More make larger files.
  ReportStage report_stage = {};       ///< Stages: sample, compare.
};

/// The signed distances from the CAD to the scan along the CAD's normals, positive where the prototype is
/// proud of the CAD. Arrays have an element for each point of `cad`.
struct Deviation {
  SurfaceSamples cad;              ///< The prototype's frame.
  std::vector<float> distances_m;  ///< NaN where nothing was measured.
  std::vector<float> stddevs_m;    ///< From the scan's noise and the registration's covariance; NaN likewise.
  std::vector<DeviationState> states;
  /// The scan's noise as a multiple of its stated standard deviations, at least 1. It is estimated from how
  /// much the distances scatter about their neighbourhood.
  double noise_factor = 1;
  /// False: the scan has no standard deviations, or some that are not positive numbers; they come from the
  /// scatter.
  bool noise_was_stated = true;
  /// Area that is not measured, with scan within the tolerance that faces the other way: triangles of the CAD
  /// that are inside out, or the back of a sheet that is thinner than the tolerance.
  double facing_away_m2 = 0;
  double tolerance_m = 0.5e-3;
  double reach_m = 5e-3;

  bool has(std::size_t i) const {
    return states[i] == DeviationState::measured || states[i] == DeviationState::uncertain;
  }
};

/// Compares the scan with the CAD at the registration's pose. From every point of the CAD it looks along the
/// normal for the scan's surface that faces the same way; nothing is extrapolated beyond the scan's
/// triangles, and those near its edges are not used. Errors: a scan without triangles, nothing of it near the
/// CAD.
Result<Deviation> deviation(const scene::Mesh& cad,
                            const scene::ScanSurface& scan,
                            const Registration& registration,
                            const DeviationOptions& options = {});

/// The places where the deviation is largest.
struct DeviationExtreme {
  std::size_t sample = 0;  ///< The point of the CAD.
  Eigen::Vector3d p_prototype = Eigen::Vector3d::Zero();
  double distance_m = 0, stddev_m = 0;
  double area_m2 = 0;  ///< The area of the connected region beyond the tolerance around it.
};

/// The largest deviation in each connected region of certain points on one side of the tolerance, the largest
/// first. It must exceed the tolerance by two standard deviations. Regions below `least_area_m2` are left
/// out. Without any region the proudest and the shyest point.
std::vector<DeviationExtreme> extremes(const Deviation& deviation,
                                       std::size_t most = 12,
                                       double least_area_m2 = 2e-6);

/// Numbers of the whole comparison. Distances are those of certain points, weighted by their areas.
struct DeviationSummary {
  std::array<double, 4> areas_m2{};  ///< By DeviationState.
  double within_share = 0;           ///< Share of the certain area within the tolerance.
  double mean_m = 0, rms_m = 0, median_stddev_m = 0;
  double lowest_m = 0, highest_m = 0;
  double p95_m = 0;  ///< 95 % of the certain points have a smaller absolute distance.
};
DeviationSummary summary_of(const Deviation& deviation);

/// The part of a scan inside a box of the prototype's frame, for a fit on it alone.
scene::ScanSurface part_in_box(const scene::ScanSurface& scan,
                               const Pose& world_from_prototype,
                               const Eigen::Vector3d& low,
                               const Eigen::Vector3d& high);

}  // namespace limn::calib
