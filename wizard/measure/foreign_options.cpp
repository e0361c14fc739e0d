#include "wizard/measure/foreign_options.h"

#include "wizard/measure/pixel_size.h"

namespace limn::wizard {
namespace {

// A board that nobody has, for scans whose images show none.
constexpr const char* k_no_board = "charuco:30x30:1mm";

Result<calib::CaptureSet> foreign_captures(const std::filesystem::path& folder,
                                           const std::vector<std::string>& skip_poses,
                                           const ForeignOptions& foreign,
                                           bool needs_board) {
  const std::string format = k_import_formats.text(*foreign.import_format);
  if (foreign.projector.empty() || (needs_board && foreign.board.empty()))
    return usage_error("--import {}: needs --projector 1024x768{}.", format,
                       needs_board ? " and --board chessboard:9x7:75mm" : "");
  LIMN_TRY(const PixelSize size, parse_pixel_size(foreign.projector));
  const auto board = calib::Board::parse(foreign.board.empty() ? k_no_board : foreign.board);
  if (!board) return usage_error("--board: {}", board.message());
  return calib::import_opencv_gray({folder, size.width, size.height, *board, foreign.poses, foreign.shots,
                                    skip_poses, foreign.order, foreign.step_px});
}

}  // namespace

Result<calib::CaptureSet> captures_of(const std::filesystem::path& folder,
                                      const std::vector<std::string>& skip_poses,
                                      const ForeignOptions& foreign,
                                      bool needs_board) {
  if (foreign.import_format) return foreign_captures(folder, skip_poses, foreign, needs_board);
  if (!foreign.projector.empty() || !foreign.board.empty() || !foreign.order.empty() || foreign.step_px != 0)
    return usage_error(
        "--projector, --board, --order and --step describe captures of other programs: they need --import "
        "opencv-gray.");
  return calib::load_captures(folder, skip_poses);
}

}  // namespace limn::wizard
