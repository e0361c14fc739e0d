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
  double border_cells = 1;  ///< width of the border in cells; for a barcode (barcode.h) it is cells / 2
  /// Number of wrong bits that are corrected, by the number of bits that cannot be read (covered). It is
  /// small enough that the code is the only one possible, and that a quad with random cells is taken for a
  /// marker at most once in 5000 times (family.cpp). The list ends where even correct remaining bits would
  /// not be enough.
  std::vector<int> max_errors;
  /// By id, then by k: the code as it is read when the marker's own top-left corner lies at the k-th corner
  /// of the quad (clockwise). k = 0 is upright.
  std::vector<std::array<std::uint64_t, 4>> codes;
};

/// An ARToolKit template: size x size grey values of the marker's inner half (the border is a quarter of the
/// side wide), smoothed(), with zero mean and unit length, in four rotations as in CodeFamily.
struct TemplatePattern {
  std::string id;
  int size = 0;
  std::array<std::vector<float>, 4> rotations;
  std::vector<std::uint8_t> grey;  ///< upright, as stored
};

/// A size x size image blurred by (1 2 1)/4 along rows and columns. Templates and the images compared with
/// them are blurred so, so that a misplacement of half a cell costs little.
std::vector<float> smoothed(std::vector<float> values, int size);
/// The same in place; `scratch` has the same size as `values`.
void smooth(std::span<float> values, std::span<float> scratch, int size);

/// The marker families that a detector searches for.
class Families {
 public:
  /// Names as in docs/formats.md: `apriltag_36h11`, `apriltag_25h9`, `apriltag_16h5`, `apriltag_36h10`,
  /// `aruco_4x4_50` … `aruco_7x7_1000`, `aruco_original`, `aruco:FILE.yml` (OpenCV dictionary file),
  /// `artoolkit_3x3` and the other barcodes (barcode.h), `artoolkit:FILE.patt`. Relative file names start in
  /// `folder`; a family or id that comes from a file gets the file's own name without folders. Errors name
  /// unknown families (and list the known ones) and broken files.
  static Result<Families> load(std::span<const std::string> names, const std::filesystem::path& folder = {});

  const std::vector<CodeFamily>& codes() const { return codes_; }
  const std::vector<TemplatePattern>& templates() const { return templates_; }

 private:
  std::vector<CodeFamily> codes_;
  std::vector<TemplatePattern> templates_;
};

/// The family names to load so that every marker of the bodies can be found; each name once.
std::vector<std::string> families_of(std::span<const Body> bodies);

/// The upright marker as printed: 8-bit grey, with its black border, without white margin, `pixels_per_cell`
/// pixels for each cell. An ARToolKit template has 2 cells for every value along a side. For a barcode, whose
/// border may end at half a cell, the number counts pixels for each half cell. Relative file names as in
/// load().
Result<cv::Mat> draw_marker(const MarkerName& marker,
                            int pixels_per_cell,
                            const std::filesystem::path& folder = {});

}  // namespace limn::tracker
