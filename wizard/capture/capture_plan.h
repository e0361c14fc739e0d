#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board_print.h"
#include "calib/code/patterns.h"
#include "core/photometric_response.h"
#include "core/pose.h"
#include "core/result.h"

namespace limn::wizard {

/// What to capture (limn.plan/1): the rig, the board and the code, and the board poses for a virtual rig.
struct Plan {
  std::filesystem::path world;  ///< the virtual rig's world file
  calib::Board board;
  calib::PatternCode code = calib::PatternCode::gray;
  calib::CodeOptions code_options;
  /// Measured responses for the code phase; empty: waves are drawn with code_options.gamma.
  std::vector<ProjectorResponse> responses;
  /// The size of the print, measured by hand: "board_measured_mm", "board_measured_stddev_mm".
  std::optional<calib::BoardMeasured> board_measured = {};
  std::vector<Pose> world_from_board;  ///< board frame as in calib/board/board.h
  bool response = false;               ///< also capture the response images, of the prototype
};

/// Reads a plan; `world` is relative to the plan's folder.
Result<Plan> load_plan(const std::filesystem::path& path);

}  // namespace limn::wizard
