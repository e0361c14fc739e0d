#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "tracker/family.h"
#include "tracker/pattern_fit.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// What a quad's inside says.
struct Identity {
  MarkerName marker;
  std::size_t first_corner = 0;  ///< which of the quad's corners is the marker's own top left
  double score = 0;              ///< as Detection::score
  SeenCells cells = {};          ///< the code's, as the quad should show them; none of a template
};

/// Whether the inside could be a marker's at all, for a quad good to a few pixels: a dark border around
/// something lighter, by at least min_contrast levels. Costs a tenth of refining it.
bool may_be_marker(const cv::Mat& grey, const Quad& quad, double min_contrast);

/// Whether it could be a code of which a part is hidden: most of the border dark, cells that change as often
/// as a code's do. Says no to nine in ten quadrilaterals of clutter.
bool may_be_covered_code(const cv::Mat& grey, const Quad& quad);

/// Least correlation of a template with what a quad shows, and how far its best rotation must lead the
/// second.
constexpr double k_min_correlation = 0.65;  // see numbers of the real Hiro frame in the tests
constexpr double k_min_rotation_lead = 0.1;

/// Whether a black border a quarter of the side wide runs all around: ARToolKit's barcodes and templates.
bool has_quarter_border(const cv::Mat& grey, const RefinedQuad& quad);

/// What a reader may count on.
enum class Reading {
  open,    ///< all cells are seen, in one light
  covered  ///< some may be hidden, shadows may cross: codes only, hidden bits count as such
};

/// Whether codes of the family are read where cells are hidden. Of those with few bits clutter shows some by
/// chance.
bool can_be_covered(const CodeFamily& family);

/// What an identity's score is worth.
enum class Certainty {
  any,     ///< nothing: some marker could be there, at a part of the cost
  weighed  ///< see identify()
};

/// Readings less sure than this are none: the one reject level of codes, barcodes and templates.
constexpr double k_min_confidence = 0.9;

/// Reads the quad's cells through its homography and compares them with every family. The limit between black
/// and white comes from the levels beside the four edges, as a plane over the marker, so that a gradient of
/// light does no harm. Of all that a family accepts the pattern that explains the whole square best is the
/// marker. Its score is the probability that it is right: against the next best pattern of any family, turn
/// or template, and against something that nobody looks for. tests/bench/id_bench counts both.
std::optional<Identity> identify(const cv::Mat& grey,
                                 const RefinedQuad& quad,
                                 const Families& families,
                                 Reading reading = Reading::open,
                                 Certainty certainty = Certainty::weighed);

}  // namespace limn::tracker
