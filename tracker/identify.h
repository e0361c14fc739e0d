#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "tracker/family.h"
#include "tracker/pattern_fit.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// The marker that a quad's inside shows.
struct Identity {
  MarkerName marker;
  std::size_t first_corner = 0;  ///< which of the quad's corners is the marker's own top left
  double score = 0;              ///< as Detection::score
  SeenCells cells = {};          ///< the code's cells, as the quad should show them; empty for a template
};

/// The smallest correlation of a template with what a quad shows, and the smallest lead of its best rotation
/// over the second best.
constexpr double k_min_correlation = 0.65;  // the tests show the numbers of the real Hiro frame
constexpr double k_min_rotation_lead = 0.1;

/// Whether a black border of that width (share of the side) runs all around, as in ARToolKit's barcodes and
/// templates.
bool has_dark_border(const cv::Mat& grey, const RefinedQuad& quad, double border);

/// What may be assumed when a quad is read.
enum class Reading {
  open,  ///< all cells are visible, in uniform light
  /// Something may lie over a part of the border along one side. Only codes that are not read when covered
  /// (can_have_broken_side), with every cell right and light paper around.
  broken_side,
  covered  ///< cells may be hidden and shadows may cross: codes only, hidden bits are counted as hidden
};

/// Whether codes of the family are read where cells are hidden. Families with few bits are not, because
/// clutter shows some of their codes by chance, and neither are those with cells around their square.
bool can_be_covered(const CodeFamily& family);

/// Whether codes of the family are read with one broken side: those of which no cell can be covered.
bool can_have_broken_side(const CodeFamily& family);

/// Whether an identity's score is computed.
enum class Certainty {
  any,     ///< no: the identity only says that some marker could be there, at a part of the cost
  weighed  ///< yes: see identify()
};

/// Readings with a lower score are rejected; the same limit holds for codes, barcodes and templates.
constexpr double k_min_confidence = 0.9;

/// Reads the quad's cells through its homography and compares them with every family. The limit between black
/// and white comes from the levels beside the four edges, as a plane over the marker, so that a gradient of
/// light does no harm. Of all patterns that a family accepts, the one that explains the whole square best is
/// the marker. Its score is the probability that it is right. The alternatives are the next best pattern of
/// any family, rotation or template, a code in another grid of cells, and something unknown.
/// tests/bench/id_bench checks both.
std::optional<Identity> identify(const cv::Mat& grey,
                                 const RefinedQuad& quad,
                                 const Families& families,
                                 Reading reading = Reading::open,
                                 Certainty certainty = Certainty::weighed);

}  // namespace limn::tracker
