#include <opencv2/core.hpp>
#include <utility>

#include "validate/check_images.h"
#include "validate/check_measures.h"

namespace limn::validate {
namespace {

constexpr float k_same_reach =
    0.02F;  // share of a pixel: two projectors with a smaller difference reach it equally well

// The smallest and largest light that a projector would show alone, of those that reach a pixel best.
std::pair<cv::Mat, cv::Mat> bounds_of_light(CheckRun& run) {
  cv::Mat low(run.check().viewer.height, run.check().viewer.width, CV_32FC3, cv::Scalar::all(0)),
      high = low.clone();
  const std::vector<cv::Mat> reaches = run.reference_view().reaches();
  cv::Mat best = reaches[0].clone();
  for (const cv::Mat& reach : reaches) best = cv::max(best, reach);
  cv::Mat begun(low.size(), CV_8U, cv::Scalar(0));
  for (std::size_t i = 0; i < reaches.size(); ++i) {
    const cv::Mat alone = run.reference_view().rendered_light(i, run.reference_projector_images()[i].light);
    const cv::Mat candidate = (reaches[i] > 0) & (reaches[i] >= best - k_same_reach);
    cv::Mat(cv::min(low, alone)).copyTo(low, candidate & begun);
    cv::Mat(cv::max(high, alone)).copyTo(high, candidate & begun);
    alone.copyTo(low, candidate & ~begun);
    alone.copyTo(high, candidate & ~begun);
    begun |= candidate;
  }
  return {low, high};
}

// Where a projector shows full light in a channel, CV_8UC3: it can give no more there.
cv::Mat at_full_light(CheckRun& run) {
  std::vector<cv::Mat> full;
  for (const cv::Mat& image : run.projector_images()) full.push_back(image == cv::Scalar::all(255));
  return run.reference_view().rendered_light(full) > 0;
}

}  // namespace

Status judge_shone(CheckRun& run) {
  const cv::Mat actual = run.reference_view().rendered_light(run.projector_images());
  auto [low, high] = bounds_of_light(run);
  cv::Mat(cv::min(low, cv::Scalar::all(1))).copyTo(low, at_full_light(run));
  const cv::Mat illuminated = any_channel_over(actual, k_dark) | any_channel_over(high, k_dark);
  if (cv::countNonZero(illuminated) == 0)
    return run.nothing_to_judge("shone_…", "a part on the prototype in the viewer's image");
  const cv::Mat below = low - actual, above = actual - high;
  cv::Mat off = cv::max(below, above);
  off = cv::max(off, 0.0);
  const cv::Mat expected = (low + high) / 2;
  const LevelErrors errors = level_errors(off * 255, expected * 255, illuminated);
  run.set("shone_mean_255", errors.mean);
  run.set("shone_over4_share", errors.over);
  run.set("shone_inner_over4_share", errors.inner_over);
  run.add({"shone", "Light on the prototype, from the viewpoint", level_errors_caption(errors, illuminated),
           srgb_image(actual), srgb_image(expected), amplified(off)});
  return {};
}

Status judge_spill(CheckRun& run) {
  double spilt = 0, all = 0;
  for (std::size_t i = 0; i < run.reference_projector_images().size(); ++i) {
    const cv::Mat light = linear_light(run.projector_images()[i]);
    cv::Mat forbidden = light.clone();
    forbidden.setTo(0, run.reference_projector_images()[i].cover > 0);
    const cv::Scalar sum = cv::sum(light), lost = cv::sum(forbidden);
    all += sum[0] + sum[1] + sum[2];
    spilt += lost[0] + lost[1] + lost[2];
    const std::string& name = run.check().renderer_input.rig.projectors[i].name;
    run.add({"spill-" + name, "Light of " + name,
             "Expected: this projector alone, before light is shared. Difference: light where no part needs "
             "it, amplified 32 times.",
             srgb_image(light), srgb_image(run.reference_projector_images()[i].light), amplified(forbidden)});
  }
  if (all == 0) return run.nothing_to_judge("spill_share", "light");
  run.set("spill_share", spilt / all);
  return {};
}

}  // namespace limn::validate
