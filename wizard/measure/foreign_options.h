#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "core/enum_names.h"
#include "core/result.h"

namespace limn::wizard {

/// How another program stores its captures.
enum class ImportFormat { opencv_gray };
inline constexpr EnumNames<ImportFormat, 1> k_import_formats{{"opencv-gray"}};

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
};

/// Loads captures of Limn or of another program. `needs_board`: a board must be named; without it foreign
/// captures have a board that they never show. Usage errors: an option that is missing, malformed, or needs
/// --import.
Result<calib::CaptureSet> captures_of(const std::filesystem::path& folder,
                                      const std::vector<std::string>& skip_poses,
                                      const ForeignOptions& foreign,
                                      bool needs_board = true);

}  // namespace limn::wizard
