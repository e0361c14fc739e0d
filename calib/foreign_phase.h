#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/code/phase_import.h"
#include "core/result.h"

namespace limn::calib {

/// Phase-shift images of one projector that another program captured with one or more cameras.
struct ForeignPhaseCaptures {
  std::filesystem::path folder;
  int projector_width = 0;
  int projector_height = 0;
  Board board;
  std::string poses = "pose*";         ///< as in ShotPlaces (calib/shot_files.h)
  std::string shots = "*";             ///< as in ShotPlaces
  std::vector<std::string> skip = {};  ///< as in load_captures
  PhaseSeries series = {};
};

/// Finds the images, decodes them and stores them as Limn's own phase code in a temporary folder that exists
/// as long as the result (PhaseSeries, recoded()). Whether white and black are there is told by the number of
/// images; `series.white` says where they are then. Errors: as find_shots, check and recoded; a number of
/// images that the description does not give.
Result<CaptureSet> import_phase(const ForeignPhaseCaptures& foreign);

}  // namespace limn::calib
