#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "apps/check_file.h"
#include "core/result.h"

namespace limn::apps {

/// A measure with its verdict.
struct CheckReading {
  CheckLimit limit;
  double value = 0;
  bool good() const { return limit.measure.least ? value >= limit.value : value <= limit.value; }
  /// Share of the limit that is used up: above 1 it is missed. Orders readings of different measures.
  double strain() const;
};

/// What was drawn, what it should be, and how they differ, for people to look at (8-bit BGR).
struct CheckPicture {
  std::string file;  ///< without -actual.png, -expected.png, -difference.png
  std::string title;
  std::string caption;
  cv::Mat actual, expected, difference;
};

struct CheckResult {
  std::string name;
  std::string about;
  std::vector<CheckReading> readings;  ///< in the order of check_measures()
  std::vector<CheckPicture> pictures;
  double seconds = 0;
  std::string problem;  ///< why nothing was measured; empty: it was
  bool good() const;
};

/// Draws what the check's limits ask for and measures it against the ray tracer. A GL context must be
/// current.
///
/// The stage is what a renderer can answer for: the world's true rig and its bare prototype, white, in the
/// dark; projectors with a gamma of 2.2 and none of the other effects. Then the sum of their light on a point
/// is the colour that was asked for. What is compared with what:
/// - `texture_mm`, `parallax_mm`: discs on and 50 mm off the surface instead of the scene's parts. Each pixel
///   of the projectors' pictures is followed by a ray to where it lands; the centroid of a disc's light
///   against the point that it was aimed at, or against the disc as the viewer's eye sees it.
/// - `shared_mm`: the latter drawn for the eye that several share, as each of them sees it who has a share.
/// - `shone_…`: the projectors' pictures, shone and photographed from the viewer's eye in linear light,
/// against
///   the ray-traced light of the parts (sim::Aim) averaged over the same projector pixels, for light cannot
///   be finer. Where several projectors reach, any sharing between them is right: the light must lie between
///   what each would give alone.
/// - `drawn_…`: the composite of whole parts over black at camera 0 against sim::Aim, sRGB levels.
///   Of both: mean over the pixels that show a part or should; share of all pixels that are more than 4/255
///   off; the same of the shown ones around which the expected picture is even.
/// - `spill_share`: linear light in projector pixels no point of which a part asks for, of all linear light.
/// - `mask_iou`: coverage masks in the viewer's picture against sim::Truth's.
/// - `composite_px`: outline of each part at camera 0, at twice the resolution; the worst part's RMS.
/// - `edge_…`: camera 0's picture of the projectors' light, drawn for its eye, with the `rest` composite over
///   it, against the parts as sim::Aim sees them, where sim::Truth's masks meet.
/// - `depth_order_share`: which part is seen at camera 0, over the pixels whose rays meet a part and
/// something
///   else.
/// - `seam_step_…`: an even coat of light over the whole prototype instead of the parts, from the viewer's
/// eye;
///   how far its luminance varies within 9 x 9 pixels, as a share of it: 95 % along the lines where another
///   set of projectors begins, and the largest anywhere that the projectors can light evenly. Traced by 2 x 2
///   rays a pixel.
/// - `black_step_share`: light of black where nothing is shown, evened out by the renderer
///   (LightOptions::even_black), of projectors with the world's black level, falloff and incidence and
///   responses that say so; the worst variation along those lines, as a share of the mean black of one
///   projector there.
/// - `refill_…`: a session with a hand in it (apps/refill.h) on the world as it is, with its room, its
/// cameras' noise
///   and its projectors' effects; an even coat where no part is shown.
/// - `rerun_worst_255`: pictures of two renderers, level by level.
///
/// Error: nothing to judge by a measure, such as no part in the picture.
Result<CheckResult> judged(const Check& check);

}  // namespace limn::apps
