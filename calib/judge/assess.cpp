#include "calib/judge/assess.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/judge/fault_costs.h"
#include "calib/judge/lens_uncertainty.h"
#include "calib/judge/smooth_errors.h"
#include "calib/judge/uncertainty.h"
#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

// A left-out board errs by the rig's error and by its own bend and pose error, in about equal parts: the
// rig's share is sqrt(1/2).
constexpr double k_rig_of_held_out = 0.71;
constexpr int k_coverage_grid = 10;

// Accumulates one device's points.
struct Tally {
  DeviceQuality quality;
  double squared = 0;
  std::set<int> cells;

  void add(const Vector2d& px, const CapturedDevice& device, const Vector2d& residual, bool outlier) {
    const int x =
        std::clamp(static_cast<int>((px.x() + 0.5) / device.width * k_coverage_grid), 0, k_coverage_grid - 1);
    const int y = std::clamp(static_cast<int>((px.y() + 0.5) / device.height * k_coverage_grid), 0,
                             k_coverage_grid - 1);
    cells.insert(y * k_coverage_grid + x);
    ++quality.points;
    if (outlier) {
      ++quality.outliers;
    } else {
      squared += residual.squaredNorm();
    }
  }
  DeviceQuality finished(const std::string& name) {
    quality.name = name;
    const int inliers = quality.points - quality.outliers;
    quality.rms_px = inliers > 0 ? std::sqrt(squared / inliers) : 0;
    quality.coverage = static_cast<double>(cells.size()) / (k_coverage_grid * k_coverage_grid);
    return quality;
  }
};

std::vector<DeviceQuality> device_qualities(const Observations& observations, const Solution& solution) {
  std::vector<Tally> cameras(observations.cameras.size()), projectors(observations.projectors.size());
  for (size_t i = 0; i < observations.corners.size(); ++i) {
    const CornerObservation& seen = observations.corners[i];
    const auto camera = static_cast<size_t>(seen.camera);
    cameras[camera].add(seen.px, observations.cameras[camera], solution.corner_residuals[i],
                        solution.corner_outlier[i]);
  }
  for (size_t i = 0; i < observations.matches.size(); ++i) {
    const Match& match = observations.matches[i];
    const auto projector = static_cast<size_t>(match.projector);
    projectors[projector].add(match.px_projector, observations.projectors[projector],
                              solution.match_residuals[i], solution.match_outlier[i]);
  }
  std::vector<DeviceQuality> qualities;
  for (size_t i = 0; i < cameras.size(); ++i)
    qualities.push_back(cameras[i].finished(observations.cameras[i].name));
  for (size_t i = 0; i < projectors.size(); ++i)
    qualities.push_back(projectors[i].finished(observations.projectors[i].name));
  return qualities;
}

// For each projector: the distance on the boards, mm, that 95 % of the held-out errors stay within, of what
// is smooth over a board in them: the noise of single matches is no error of the rig. A pose that differs
// from all others (odd_pose) is a fault of its own: how far it moves the solution is in the jackknife.
std::vector<double> held_out_errors_mm(const Observations& observations,
                                       const Solution& solution,
                                       const CrossValidation& score) {
  struct Errors {
    std::vector<double> mm;
    double squared = 0, noise = 0;  // px^2
  };
  std::set<std::string> odd;
  for (const OddPose& pose : odd_poses(score)) odd.insert(score.poses[pose.index].pose);
  std::vector<Errors> errors(observations.projectors.size());
  for (const SmoothErrors& group : smooth_errors(observations, solution, score)) {
    if (odd.contains(observations.poses[static_cast<size_t>(group.pose)])) continue;
    double square_m = 0, square_px = 0;
    for (const size_t match : group.matches) {
      if (!std::isfinite(score.errors_m[match])) continue;
      square_m += score.errors_m[match] * score.errors_m[match];
      square_px += score.residuals[match].squaredNorm();
    }
    const double mm_per_px = square_px > 0 ? 1e3 * std::sqrt(square_m / square_px) : 0;
    Errors& of = errors[static_cast<size_t>(group.projector)];
    for (Eigen::Index i = 0; i < group.residuals.rows(); ++i)
      of.mm.push_back(mm_per_px * group.residuals.row(i).norm());
    of.squared += group.residuals.squaredNorm();
    of.noise += group.noise;
  }
  std::vector<double> p95;
  for (Errors& of : errors) {
    const double rig_share = of.squared > 0 ? std::sqrt(std::max(0.0, 1 - of.noise / of.squared)) : 0;
    p95.push_back(of.mm.empty() ? std::numeric_limits<double>::infinity()
                                : rig_share * quantile(std::move(of.mm), 0.95));
  }
  return p95;
}

// Moves the faults that cost nothing where the predicted error is good to the advice.
void separate_advice(Assessment* assessment) {
  const auto is_advice = [](const Fault& fault) {
    return fault.severity == Severity::note &&
           (fault.name == FaultName::little_overlap || fault.name == FaultName::low_coverage);
  };
  for (const Fault& fault : assessment->faults) {
    if (is_advice(fault)) assessment->advice.push_back(fault);
  }
  std::erase_if(assessment->faults, is_advice);
}

// The verdict on cameras alone, from the held-out corners and from how well the lenses are determined.
void judge_cameras(const Observed& observed, const Solution& solution, Assessment* assessment) {
  double worst = 0;
  for (size_t i = 0; i < solution.rig.cameras.size(); ++i) {
    assessment->lens_stddev_px.push_back(lens_stddev_px(solution, i));
    worst = std::max(worst, assessment->lens_stddev_px.back());
  }
  assessment->normalised_residuals = normalised_residuals(observed.observations, solution, {});
  assessment->faults = merged(faults(observed, solution, assessment->devices, assessment->held_out));
  const double px = assessment->held_out.rms_px;
  const Severity severity = heaviest(assessment->faults);
  if (px <= k_good_px && worst <= k_good_lens_px && severity == Severity::note)
    assessment->verdict = Verdict::good;
  else if (px <= k_usable_px && worst <= k_usable_lens_px && severity != Severity::reject)
    assessment->verdict = Verdict::usable;
}

}  // namespace

std::string to_text(Verdict verdict) {
  switch (verdict) {
    case Verdict::good:
      return "good";
    case Verdict::usable:
      return "usable";
    case Verdict::reject:
      break;
  }
  return "reject";
}

double Assessment::worst_predicted_mm() const {
  return predicted_error_mm.empty() ? std::numeric_limits<double>::infinity()
                                    : *std::max_element(predicted_error_mm.begin(), predicted_error_mm.end());
}

void add_faults(const std::vector<Fault>& faults, Assessment* assessment) {
  assessment->faults.insert(assessment->faults.end(), faults.begin(), faults.end());
  assessment->faults = merged(assessment->faults);
  const Severity severity = heaviest(faults);
  if (severity == Severity::reject) assessment->verdict = Verdict::reject;
  if (severity == Severity::doubt) assessment->verdict = std::max(assessment->verdict, Verdict::usable);
}

Assessment assess(const Observed& observed,
                  const Solution& solution,
                  CrossValidation held_out,
                  const SolveOptions& options) {
  const Observations& observations = observed.observations;
  Assessment assessment;
  assessment.held_out = std::move(held_out);
  assessment.devices = device_qualities(observations, solution);
  if (observations.projectors.empty()) {
    judge_cameras(observed, solution, &assessment);
    return assessment;
  }
  const Solution judged = with_distortion_unknown(observations, solution, options);
  const Uncertainty uncertainty =
      estimated_uncertainty(observations, judged, unknown_distortion(solution, options), assessment.held_out);
  assessment.epipolar = epipolar_residuals(solution.rig, observed.dense);
  assessment.normalised_residuals =
      normalised_residuals(observations, solution, assessment.held_out.residuals);
  assessment.held_out_error_mm = held_out_errors_mm(observations, solution, assessment.held_out);
  assessment.propagated_error_mm = propagated_error_mm(observations, judged, uncertainty);
  assessment.error_maps = error_maps(observations, judged, uncertainty);
  for (size_t i = 0; i < assessment.held_out_error_mm.size(); ++i)
    assessment.predicted_error_mm.push_back(
        std::max(k_rig_of_held_out * assessment.held_out_error_mm[i], assessment.propagated_error_mm[i]));
  double lit = 0, decoded = 0, contrasted = 0;
  for (const DecodeShare& share : observed.decoded) {
    lit += share.lit;
    decoded += share.decoded;
    contrasted += share.contrasted;
    assessment.decode_outliers += share.outliers;
  }
  assessment.decoded_share = lit > 0 ? decoded / lit : 0;
  assessment.decoded_of_contrasted = contrasted > 0 ? decoded / contrasted : 0;
  assessment.faults = merged(faults(observed, solution, assessment.devices, assessment.held_out));
  const double px = assessment.held_out.rms_px;
  const double mm = assessment.worst_predicted_mm();
  state_costs(observations, solution, mm, &assessment.faults);
  const double on_boards_mm =
      *std::max_element(assessment.held_out_error_mm.begin(), assessment.held_out_error_mm.end());
  const bool extrapolates = mm > std::max(k_fine_mm, k_beyond_boards * on_boards_mm);
  if (mm <= k_good_mm && !extrapolates) separate_advice(&assessment);
  const Severity severity = heaviest(assessment.faults);
  if (px <= k_good_px && mm <= k_good_mm && !extrapolates && severity == Severity::note) {
    assessment.verdict = Verdict::good;
  } else if (px <= k_usable_px && mm <= k_usable_mm && severity != Severity::reject) {
    assessment.verdict = Verdict::usable;
  }
  return assessment;
}

Result<Assessment> assess(const Observed& observed, const SolveOptions& options, const Solution& solution) {
  LIMN_TRY(CrossValidation score, cross_validate(observed.observations, options, solution));
  return assess(observed, solution, std::move(score), options);
}

}  // namespace limn::calib
