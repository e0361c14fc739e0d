#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/marker_drawing.h"
#include "core/result.h"
#include "tracker/code_grid.h"

namespace limn::tracker {

/// Square codes: bits inside a black border, and for AprilTag 3's families (apriltag_codes.h) also around it.
/// A code is read row by row from the top left, first bit highest; 1 is white. Of markers whose square is
/// light on dark, everything is described as it looks in the inverted image.
struct CodeFamily {
  std::string name;
  int cells = 0;            ///< cells along a side inside the border
  double border_cells = 1;  ///< width of the border in cells; for a barcode (barcode.h) it is cells / 2
  CodeGrid grid;            ///< a barcode's border counts as one ring of cells
  bool light_on_dark = false;
  /// Number of wrong bits that are corrected, by the number of bits that cannot be read (covered). It is
  /// small enough that the code is the only one possible, and that a quad with random cells is taken for a
  /// marker at most once in 5000 times (family.cpp). The list ends where even correct remaining bits would
  /// not be enough.
  std::vector<int> max_errors;
  /// By id, then by k: the code as it is read when the marker's own top-left corner lies at the k-th corner
  /// of the quad (clockwise). k = 0 is upright.
  std::vector<std::array<std::uint64_t, 4>> codes;
};

/// Whether the family is one of ARToolKit's barcodes. (A border of two cells around 4 x 4 cells would look
/// the same; Families has none.)
bool is_barcode(const CodeFamily& family);

/// An ARToolKit template's pattern ratio: its pattern's width as share of the square's side.
constexpr double k_least_pattern_ratio = 0.2, k_most_pattern_ratio = 0.95;
constexpr bool is_pattern_ratio(double ratio) {
  return ratio >= k_least_pattern_ratio && ratio <= k_most_pattern_ratio;
}

/// An ARToolKit template: size x size grey values of the marker's inside, smoothed(), with zero mean and unit
/// length, in four rotations as in CodeFamily.
struct TemplatePattern {
  std::string family;  ///< `artoolkit` or `artoolkit_inverted`
  std::string id;
  int size = 0;
  double border = 0.25;  ///< width of the border as share of the square's side: (1 - pattern ratio) / 2
  bool light_on_dark = false;
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
  /// Names as in docs/formats.md: `apriltag_36h11` and the other dictionaries of OpenCV
  /// (core/predefined_family.h), `aruco_mip_36h12`, `apriltag_41h12` and the other families of AprilTag 3
  /// (apriltag_codes.h), `aruco:FILE.yml` (OpenCV dictionary file), `artoolkit_3x3` and the other barcodes
  /// (barcode.h), `artoolkit:FILE.patt`, `artoolkit:FILE.patt@0.8` (its pattern is 0.8 of the square's side
  /// wide; 0.5 unless stated). `_inverted` at the end of the word before a colon means the same markers in
  /// inverted colours. Relative file names start in `folder`; a family or id that comes from a file gets the
  /// file's own name without folders. Errors name unknown families (and list the known ones), broken files,
  /// and markers of a dictionary file that look the same.
  static Result<Families> load(std::span<const std::string> names, const std::filesystem::path& folder = {});

  const std::vector<CodeFamily>& codes() const { return codes_; }
  const std::vector<TemplatePattern>& templates() const { return templates_; }
  /// The families of codes() that are also read with a border of two cells, as Kalibr prints them:
  /// those with a border of one cell and at least 5 x 5 cells. (4 x 4 cells in such a border are also
  /// ARToolKit barcodes.)
  const std::vector<CodeFamily>& wide_borders() const { return wide_borders_; }

  bool is_empty() const { return codes_.empty() && templates_.empty(); }
  /// Those whose squares are light on dark, or dark on light.
  Families with_polarity(bool light_on_dark) const;
  /// Whether markers of that name belong to a family here.
  bool contains(const std::string& family) const;
  /// Width of the thinnest border, as share of the square's side.
  double thinnest_border() const;
  /// How far the cells of a marker reach beyond its square, at most, as share of its side.
  double reach() const;

 private:
  std::vector<CodeFamily> codes_, wide_borders_;
  std::vector<TemplatePattern> templates_;
};

/// The family names to load so that every marker of the bodies can be found; each name once.
std::vector<std::string> families_of(std::span<const Body> bodies);

/// The whole marker with `pixels_per_cell` pixels for each cell. An ARToolKit template has `2 size` cells
/// along a side where its pattern ratio is 0.5; for other ratios a value may have more cells. For a barcode,
/// whose border may end at half a cell, the number counts pixels for each half cell. Relative file names as
/// in Families::load().
Result<MarkerDrawing> draw_whole_marker(const MarkerName& marker,
                                        int pixels_per_cell,
                                        const std::filesystem::path& folder = {});

/// Its square alone: the image's edge is the square's edge.
Result<cv::Mat> draw_marker(const MarkerName& marker,
                            int pixels_per_cell,
                            const std::filesystem::path& folder = {});

}  // namespace limn::tracker
