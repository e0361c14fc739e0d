#pragma once

#include <string>
#include <vector>

#include "calib/cross_validation.h"
#include "calib/judge/epipolar.h"
#include "calib/judge/error_map.h"
#include "calib/judge/faults.h"
#include "calib/judge/normalised_residuals.h"
#include "calib/observations.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

struct DeviceQuality {
  std::string name;
  double rms_px = 0;  ///< 2D error per point, over inliers
  int points = 0;
  int outliers = 0;
  double coverage = 0;  ///< share of a 10 x 10 grid over the image with at least one observation
};

enum class Verdict { good, usable, reject };
std::string to_text(Verdict verdict);

struct Assessment {
  Verdict verdict = Verdict::reject;
  std::vector<DeviceQuality> devices;
  CrossValidation held_out;
  /// 95 % errors on the surface, mm, one for each projector. Held-out: on the captured boards, of what is
  /// smooth over a board (calib/judge/smooth_errors.h). Propagated: for a target as large as the panel in
  /// place, moved and turned, by the estimated covariance (calib/judge/uncertainty.h). Predicted: the larger
  /// of the rig's share of the first and of the second.
  std::vector<double> held_out_error_mm, propagated_error_mm, predicted_error_mm;
  /// Without projectors, one for each camera: the standard deviation (px, both axes) of where the lens puts a
  /// direction, over nine tenths of its image's places, turned so that the mean shift is 0; infinite where
  /// the solve does not determine the lens. Empty with projectors.
  std::vector<double> lens_stddev_px = {};
  std::vector<ErrorMap> error_maps;  ///< one for each projector, over the volume shared with camera 0
  double decoded_share = 0;          ///< share of illuminated pixels
  double decoded_of_contrasted = 0;  ///< share of all pixels that white makes brighter than black
  int decode_outliers = 0;
  std::vector<EpipolarResidual> epipolar;    ///< over decoded pixels of the whole image, on the board or not
  NormalisedResiduals normalised_residuals;  ///< whether the stated standard deviations are true
  std::vector<Fault> faults;                 ///< one for each name
  /// What is worth knowing but costs nothing that counts: little_overlap and low_coverage where the predicted
  /// error is good.
  std::vector<Fault> advice = {};

  /// The largest predicted error; infinite without projectors.
  double worst_predicted_mm() const;
};

/// Limits of the verdict. good: a part's edge lands within a pixel and a millimetre wherever the board was;
/// both the held-out and the propagated error count, and boards that are almost parallel are never good.
/// usable: errors that a person at arm's length does not mind.
constexpr double k_good_px = 0.5, k_good_mm = 1.0;
constexpr double k_usable_px = 1.5, k_usable_mm = 3.0;
/// Cameras alone: limits of lens_stddev_px, instead of those in mm.
constexpr double k_good_lens_px = 0.3, k_usable_lens_px = 1.0;
/// Not good either: a predicted error that is many times the error on the boards, because the boards then say
/// little about the places between and beyond them (all parallel, all in the middle). Sound captures have 2
/// to 3 times, ill-posed ones over 10 times. Predicted errors below a quarter of a millimetre are fine
/// anyway.
constexpr double k_beyond_boards = 5, k_fine_mm = 0.25;

/// Adds faults found elsewhere and lowers the verdict as far as they demand.
void add_faults(const std::vector<Fault>& faults, Assessment* assessment);

/// `held_out`: cross-validation of the same solution, with its errors on the boards.
Assessment assess(const Observed& observed,
                  const Solution& solution,
                  CrossValidation held_out,
                  const SolveOptions& options = {});

/// Runs the cross-validation first. Errors: those of cross_validate().
Result<Assessment> assess(const Observed& observed, const SolveOptions& options, const Solution& solution);

}  // namespace limn::calib
