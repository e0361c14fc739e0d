#pragma once

#include <string>
#include <vector>

#include "calib/cross_validation.h"
#include "calib/observations.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// A lens model that was tried for one device, with the models of the others as chosen so far.
struct ModelTrial {
  std::string device;
  std::string model;
  double held_out_px = 0;  ///< NaN where the solve failed
  /// The gain of the richer of this model and the one it was compared with: by what share its held-out error
  /// is lower (geometric mean over poses). `uncertainty`: what chance could make of that (95 %, from how
  /// poses differ; at least 3 %). Both are 0 for the first model.
  double gain = 0;
  double uncertainty = 0;
  bool chosen = false;  ///< whether the device ended with this model
};

struct ModelSelection {
  SolveOptions options;  ///< with one model for every device
  Solution solution;
  CrossValidation held_out;
  std::vector<ModelTrial> trials;  ///< empty where all models were given
};

/// The name `auto`, given instead of a lens model's.
extern const char* const k_auto_lens;

/// Solves, and selects the lens model of each device whose model is `auto`: LENSMODEL_PINHOLE (projectors
/// only), OPENCV4, OPENCV5 or OPENCV8, by held-out error. The search is greedy, one device after another,
/// starting from OPENCV4. A richer model is chosen only when its held-out error is lower by more than chance
/// explains (Student's t over the poses' differences); otherwise the simpler one is. A projector's distortion
/// is left out only if it is within what its covariance explains, too. The returned held-out
/// error is that of the poses that were used for the selection, so it is slightly too low, but by less than
/// the stated uncertainties.
Result<ModelSelection> solve_selecting_models(const Observations& observations,
                                              const SolveOptions& options = {});

/// Solves again, with the print's errors as unknowns and lens models selected anew, where the observations
/// show that the print is uneven (uneven_print); returns `plain` otherwise. Where only the corners' fit shows
/// it, the held-out errors must be lower with the print's errors, too, by a fifth or by more than chance
/// explains: a sheet that lies differently in each of few poses also fits better, but predicts the other
/// poses worse.
Result<ModelSelection> solve_uneven_print(const Observations& observations, ModelSelection plain);

}  // namespace limn::calib
