#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/report/report.h"
#include "core/result.h"

namespace limn::apps {

struct SolveCommandOptions {
  std::filesystem::path captures;
  std::filesystem::path out;
  std::vector<std::string> skip_poses = {};  ///< names of poses to leave out
  /// A lens model's name for all cameras, all projectors; "auto": each device's by held-out error.
  std::string camera_model = "auto";
  std::string projector_model = "auto";
  /// Lengths that the cameras can see, "apriltag_36h11:3 apriltag_36h11:7 250mm" each, besides
  /// capture.json's.
  std::vector<std::string> scale_bar_lengths = {};

  std::string import_format = {};  ///< "opencv-gray": somebody else's captures; then also
  std::string projector = {};      ///< the projector's size, "1024x768"
  std::string board = {};          ///< "chessboard:9x7:75mm"
  std::string poses = "pose*";
  std::string shots = "*.png";
};

/// Captures -> rig folder (rig.json, .cameramodel files, report.json, report.html, observations.json).
/// Nothing is written unless everything is solved.
Result<calib::Report> solved(const SolveCommandOptions& options);

}  // namespace limn::apps
