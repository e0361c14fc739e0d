#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board_print.h"
#include "calib/code/patterns.h"
#include "core/imager.h"
#include "core/result.h"

namespace limn {
class ConfigNode;
}

namespace limn::calib {

/// A camera or projector of the capture.
struct CapturedDevice {
  std::string name;
  int width = 0;
  int height = 0;
  /// A camera for infrared light sees no patterns: it is calibrated by the board's corners alone, which its
  /// own lamp lights.
  Spectrum sees = Spectrum::visible;
};

/// One placement of the board (or of the scene, where no board is visible).
struct CapturedPose {
  std::string name;  ///< the directory's name
  /// images[projector][camera][pattern]: the files, in the order of the patterns.
  std::vector<std::vector<std::vector<std::filesystem::path>>> images;
};

/// A captures folder (docs/formats.md): what was shown and photographed, and where the images are.
struct CaptureSet {
  std::filesystem::path folder;
  std::vector<CapturedDevice> cameras;
  std::vector<CapturedDevice> projectors;
  std::vector<Patterns> patterns;  ///< one for each projector
  Board board;
  std::vector<CapturedPose> poses;  ///< sorted by name
  /// Lengths measured by hand, as calib/judge/scale_bar.h reads them; "scale_bar_lengths" in capture.json.
  std::vector<std::string> scale_bar_lengths = {};
  /// "board_measured_mm" and "board_measured_stddev_mm" in capture.json.
  std::optional<BoardMeasured> board_measured = {};
  /// Keeps images that an import computed (white and black of series that lack them) as long as this exists.
  std::shared_ptr<const void> made_images = {};
};

/// Reads "board_measured_mm" ([width, height]) and "board_measured_stddev_mm" (0.1 when absent) of a capture
/// or plan file; none where it has no lengths.
std::optional<BoardMeasured> read_board_measured(const ConfigNode& root);

/// A captures folder that is about to be filled: patterns of a code for every projector, no poses yet.
/// Options out of their range throw: the caller must have checked what people entered.
CaptureSet plan_captures(const std::filesystem::path& folder,
                         std::vector<CapturedDevice> cameras,
                         std::vector<CapturedDevice> projectors,
                         const Board& board,
                         PatternCode code = PatternCode::gray,
                         const CodeOptions& options = {});

/// The file of one image: pose00/camera0/000.png, or pose00/projector0/camera0/000.png where there are
/// several projectors.
std::filesystem::path image_path(
    const CaptureSet& captures, int pose, int projector, int camera, int pattern);

/// Error when the first camera sees infrared light: it places the board, shows it to people and joins the
/// projectors to the others.
Status check_spectra(const CaptureSet& captures);

/// Reads capture.json and patterns.json and lists the poses (`pose*` directories). A pose with a missing
/// image is an error that names the first missing file. Poses named in `skip` are not read; a name in it that
/// no pose has is an error.
Result<CaptureSet> load_captures(const std::filesystem::path& folder,
                                 const std::vector<std::string>& skip = {});

/// Images of a Gray code that another program captured: one projector, one or more cameras.
struct ForeignCaptureSet {
  std::filesystem::path folder;
  int projector_width = 0;
  int projector_height = 0;
  Board board;
  std::string poses = "pose*";    ///< as in ShotPlaces (calib/shot_files.h)
  std::string shots = "*";        ///< as in ShotPlaces: the images' names, for each camera
  std::vector<std::string> skip;  ///< as in load_captures
  std::string order =
      {};           ///< words about the order of the images, as in KnownOrder::parse; empty: found in them
  int step_px = 0;  ///< width of the narrowest stripes; 0: found by the number of images
};
/// Finds the images and which pattern each shows (calib/code/shot_order.h), and says so. White and black that
/// the series lack are computed.
Result<CaptureSet> import_opencv_gray(const ForeignCaptureSet& foreign);

}  // namespace limn::calib
