#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/code/phase_import.h"
#include "core/enum_names.h"
#include "core/result.h"

namespace limn::wizard {

/// How another program stores its captures.
enum class ImportFormat { opencv_gray, phase };
inline constexpr EnumNames<ImportFormat, 2> k_import_formats{{"opencv-gray", "phase"}};

/// Options that describe captures of another program.
struct ForeignOptions {
  /// Absent: captures of Limn; the members below must then keep their defaults.
  std::optional<ImportFormat> import_format = {};
  std::string projector = {};  ///< the projector's size, "1024x768"
  std::string board = {};      ///< "chessboard:9x7:75mm"
  std::string poses = "pose*";
  std::string shots = "*";
  std::string order = {};  ///< as in calib::KnownOrder::parse
  int step_px = 0;         ///< 0: found by the number of images
  /// With `phase`, as in calib::PhaseSeries: the images of a wave; the waves' lengths of columns and of rows;
  /// whether a Gray code numbers the waves; the wave's form and direction. `order` then says rows-first,
  /// where white is, and whether the cue has inverses.
  int steps = 4;
  std::vector<double> periods = {}, row_periods = {};
  bool is_cued = false;
  calib::WaveForm wave = calib::WaveForm::cosine;
  bool is_backward = false;
};

/// Loads captures of Limn or of another program. `needs_board`: a board must be named; without it foreign
/// captures have a board that they never show. Usage errors: an option that is missing, malformed, or needs
/// --import.
Result<calib::CaptureSet> captures_of(const std::filesystem::path& folder,
                                      const std::vector<std::string>& skip_poses,
                                      const ForeignOptions& foreign,
                                      bool needs_board = true);

}  // namespace limn::wizard
