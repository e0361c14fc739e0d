#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/result.h"

namespace limn::tracker {

/// Square codes of cells x cells bits inside a black border. A code is read row by row from the top left,
/// first bit highest; 1 is white.
struct CodeFamily {
  std::string name;
  int cells = 0;
  double border_cells = 1;  ///< the border's width in cells; a barcode's (barcode.h) is cells / 2
  /// Wrong bits that are still corrected, by the number of bits that cannot be read (covered): so few that
  /// the code is the only one and that a quad with random cells is taken for a marker once in 5000 times at
  /// most (family.cpp). Ends where not even flawless other bits are enough.
  std::vector<int> max_errors;
  /// By id, then by k: the code as it is seen when the marker's own top-left corner lies at the k-th corner
  /// of the quad (clockwise). k = 0 is upright.
  std::vector<std::array<std::uint64_t, 4>> codes;
};

/// An ARToolKit template: size x size grey values of the marker's inner half (its border is a quarter of the
/// side), smoothed(), with zero mean and unit length, four rotations as in CodeFamily.
struct TemplatePattern {
  std::string id;
  int size = 0;
  std::array<std::vector<float>, 4> rotations;
  std::vector<std::uint8_t> grey;  ///< upright, as stored
};

/// A size x size image blurred by (1 2 1)/4 along rows and columns: templates and what is compared with
/// them, so that half a cell of misplacement costs little.
std::vector<float> smoothed(std::vector<float> values, int size);
/// The same in place; the scratch is as large.
void smooth(std::span<float> values, std::span<float> scratch, int size);

/// What the detector looks for.
class Families {
 public:
  /// Names as in docs/formats.md: `apriltag_36h11`, `apriltag_25h9`, `apriltag_16h5`, `apriltag_36h10`,
  /// `aruco_4x4_50` … `aruco_7x7_1000`, `aruco_original`, `aruco:FILE.yml` (OpenCV dictionary file),
  /// `artoolkit_3x3` and the other barcodes (barcode.h), `artoolkit:FILE.patt`. Relative files are looked up
  /// in `folder`; a family or id that comes from a file is named by the file's own name without folders.
  /// Errors name unknown families (and list the known ones) and broken files.
  static Result<Families> load(std::span<const std::string> names, const std::filesystem::path& folder = {});

  const std::vector<CodeFamily>& codes() const { return codes_; }
  const std::vector<TemplatePattern>& templates() const { return templates_; }

 private:
  std::vector<CodeFamily> codes_;
  std::vector<TemplatePattern> templates_;
};

/// The family names to load so that every marker of the bodies can be found; each once.
std::vector<std::string> families_of(std::span<const Body> bodies);

/// The marker upright as printed: 8-bit grey, its black border included, no white margin, `pixels_per_cell`
/// pixels a cell (an ARToolKit template has 2 cells for every value along a side; of a barcode, whose border
/// may end at half a cell, it is pixels a half cell). Relative files as in load.
Result<cv::Mat> draw_marker(const MarkerName& marker,
                            int pixels_per_cell,
                            const std::filesystem::path& folder = {});

}  // namespace limn::tracker
