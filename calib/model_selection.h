#pragma once

#include <string>
#include <vector>

#include "calib/cross_validation.h"
#include "calib/observations.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// A lens model that was tried for a device, everything else as chosen so far.
struct ModelTrial {
  std::string device;
  std::string model;
  double held_out_px = 0;  ///< NaN where the solve failed
  /// By what share the richer of this model and the one it was compared with has the lower held-out error
  /// (geometric mean over poses), and what chance could make of that (95 %, from how poses differ; at least
  /// 3 %). Both 0 for the model to start with.
  double gain = 0;
  double uncertainty = 0;
  bool chosen = false;  ///< the device's model in the end
};

struct ModelSelection {
  SolveOptions options;  ///< with a model for every device
  Solution solution;
  CrossValidation held_out;
  std::vector<ModelTrial> trials;  ///< empty where no model was left open
};

/// `auto`, as a lens model's name.
extern const char* const k_auto_lens;

/// Solves; devices whose model is `auto` get LENSMODEL_PINHOLE (projectors alone), OPENCV4, OPENCV5 or
/// OPENCV8, by held-out error: greedily, one device after another, from OPENCV4 on. A richer model is taken
/// only when its held-out error is lower by more than chance could make it (Student's t over the poses'
/// differences); ties go to the simpler. The score is of the poses that chose: flattered, but by less than
/// the uncertainties told.
Result<ModelSelection> solve_selecting_models(const Observations& observations, const SolveOptions& options = {});

}  // namespace limn::calib
