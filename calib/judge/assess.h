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
  double rms_px = 0;  ///< per point, over inliers
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
  /// 95 % errors on the surface, mm, one for each projector. Held out: on the captured boards, the matches'
  /// own noise taken off. Propagated: of a thing as large as the panel in place, moved and turned, by the
  /// covariance that is believed (calib/judge/uncertainty.h). Predicted: the larger of the rig's share of the
  /// first and the second.
  std::vector<double> held_out_error_mm, propagated_error_mm, predicted_error_mm;
  std::vector<ErrorMap> error_maps;  ///< one for each projector, over the volume shared with camera 0
  double decoded_share = 0;          ///< of lit pixels
  double decoded_of_contrasted = 0;  ///< of all that white makes brighter than black
  int decode_outliers = 0;
  std::vector<EpipolarResidual> epipolar;  ///< over decoded pixels of the whole image, board or not
  NormalisedResiduals normalised_residuals;                             ///< whether the stated deviations are true
  std::vector<Fault> faults;
};

/// Limits of the verdict. Good: a part's edge lands within a pixel and a millimetre wherever the board was;
/// both the held-out and the propagated error count, and boards that are all but parallel are never good;
/// usable: within what an eye at arm's length forgives.
constexpr double k_good_px = 0.5, k_good_mm = 1.0;
constexpr double k_usable_px = 1.5, k_usable_mm = 3.0;
/// Never good either: a predicted error that is many times what the boards show, for then they say little
/// about the places between and beyond them (all parallel, all in the middle). Healthy sets: 2 to 3 times;
/// ill-posed: over 10. Below a quarter of a millimetre nobody minds.
constexpr double k_beyond_boards = 5, k_fine_mm = 0.25;

/// Adds faults found elsewhere; the verdict falls as far as they demand.
void add_faults(const std::vector<Fault>& faults, Assessment* assessment);

/// `held_out`: of the same solution, with its errors on the boards.
Assessment assess(const Observed& observed, const Solution& solution, CrossValidation held_out);

/// Likewise, leaving one pose out after the other first. Errors: those of held_out.
Result<Assessment> assess(const Observed& observed, const SolveOptions& options, const Solution& solution);

}  // namespace limn::calib
