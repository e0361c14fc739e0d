#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <string>

#include "sim/truth.h"
#include "validate/check_images.h"
#include "validate/check_measures.h"
#include "validate/metrics.h"

namespace limn::validate {
namespace {

constexpr int k_edge_window = 5;        // viewer pixels: light and screen within 2 of each other meet
constexpr int k_least_outline_px = 50;  // area of a part; a smaller part's outline says nothing

// For each pixel the index of the part that the renderer shows in front, in the format of sim::DepthOrder.
cv::Mat front_of(const std::vector<projector::PartCoverage>& coverage, const Imager& imager) {
  cv::Mat front(imager.height, imager.width, CV_16S, cv::Scalar(-1));
  for (std::size_t i = 0; i < coverage.size(); ++i)
    front.setTo(static_cast<double>(i), coverage[i].mask != 0);
  return front;
}

// Where light and screen meet within a part at camera 0, away from the part's outline.
cv::Mat light_meets_screen(CheckRun& run, const Imager& camera, const cv::Mat& cover) {
  const sim::Truth masks(run.world(), run.check().posed);
  const cv::Mat front = run.reference().depth_order(camera).front, near = square_kernel(k_edge_window),
                inner_of = square_kernel(5);
  cv::Mat meets(camera.height, camera.width, CV_8U, cv::Scalar(0));
  for (std::size_t i = 0; i < run.check().posed.parts.size(); ++i) {
    const cv::Mat mask = masks.part_mask(camera, run.check().posed.parts[i].slot);
    cv::Mat near_light, near_screen, inner;
    cv::dilate(mask == 255, near_light, near);
    cv::dilate(mask == 128, near_screen, near);
    cv::erode((front == static_cast<int>(i)) & (cover > k_whole), inner, inner_of);
    meets |= near_light & near_screen & inner;
  }
  return meets;
}

}  // namespace

Status judge_drawn(CheckRun& run) {
  LIMN_TRY(const Imager* camera, run.camera("drawn_…"));
  const cv::Mat black(camera->height, camera->width, CV_8UC3, cv::Scalar::all(0));
  const cv::Mat actual =
      run.renderer().composite(0, black, run.check().renderer_input.posed, projector::Composite::full);
  const sim::PartImage reference = run.reference().parts_image(run.world().rig.cameras.front());
  const cv::Mat expected = srgb_image(reference.light);
  const cv::Mat shown = any_channel_over(actual, 0) | (reference.cover > 0);
  if (cv::countNonZero(shown) == 0) return run.nothing_to_judge("drawn_…", "a part in camera 0's image");
  cv::Mat off, levels, expected_levels;
  cv::absdiff(actual, expected, off);
  off.convertTo(levels, CV_32F);
  expected.convertTo(expected_levels, CV_32F);
  const LevelErrors errors = level_errors(levels, expected_levels, shown);
  run.set("drawn_mean_255", errors.mean);
  run.set("drawn_over4_share", errors.over);
  run.set("drawn_inner_over4_share", errors.inner_over);
  run.add({"drawn", "Parts at " + camera->name, level_errors_caption(errors, shown), actual, expected,
           amplified(off)});
  return {};
}

Status judge_mask(CheckRun& run) {
  cv::Mat found(run.check().viewer.height, run.check().viewer.width, CV_8U, cv::Scalar(0)),
      truth = found.clone();
  for (const auto& part : run.renderer().coverage(run.check().renderer_input.posed, run.check().viewer))
    part.mask.copyTo(found, part.mask != 0);
  const cv::Mat front = run.reference().depth_order(run.check().viewer).front;
  const sim::Truth masks(run.world(), run.check().posed);
  for (std::size_t i = 0; i < run.check().posed.parts.size(); ++i)
    masks.part_mask(run.check().viewer, run.check().posed.parts[i].slot)
        .copyTo(truth, front == static_cast<int>(i));
  if (cv::countNonZero(truth) == 0) return run.nothing_to_judge("mask_iou", "a part in the viewer's image");
  run.set("mask_iou", label_iou(found, truth));
  run.add({"mask", "On and off the surface, from the viewpoint",
           "White is projected, grey is left to the screen. Difference: red.", bgr_image(found),
           bgr_image(truth), label_difference(found, truth)});
  return {};
}

Status judge_composite(CheckRun& run) {
  LIMN_TRY(const Imager* camera, run.camera("composite_px"));
  const Imager doubled = resized(*camera, 2 * camera->width, 2 * camera->height).value();
  const Imager true_doubled =
      resized(run.world().rig.cameras.front(), 2 * camera->width, 2 * camera->height).value();
  const cv::Mat found = front_of(run.renderer().coverage(run.check().renderer_input.posed, doubled), doubled);
  const cv::Mat truth = run.reference().depth_order(true_doubled).front;
  double worst_px = -1;
  std::string caption = "At twice the resolution.";
  for (std::size_t i = 0; i < run.check().posed.parts.size(); ++i) {
    const auto part = static_cast<int>(i);
    const cv::Mat expected = truth == part;
    if (cv::countNonZero(expected) < k_least_outline_px) continue;
    const double off_px = outline_distance_px(found == part, expected) / 2;
    caption += fmt::format(" {}: {:.3f} px.", run.check().posed.parts[i].slot, off_px);
    worst_px = std::max(worst_px, off_px);
  }
  if (worst_px < 0) return run.nothing_to_judge("composite_px", "a part in camera 0's image");
  run.set("composite_px", worst_px);
  run.add({"composite", "Outlines at " + camera->name, caption + " Difference: red.",
           bgr_image(owner_shades(found)), bgr_image(owner_shades(truth)),
           label_difference(owner_shades(found), owner_shades(truth))});
  return {};
}

// The projected light is drawn for the camera's own viewpoint, and the screen adds the rest: together they
// should be the parts.
Status judge_edge(CheckRun& run) {
  LIMN_TRY(const Imager* camera, run.camera("edge_…"));
  const Imager& true_camera = run.world().rig.cameras.front();
  const sim::PartImage parts = run.reference().parts_image(true_camera);
  const cv::Mat meets = light_meets_screen(run, true_camera, parts.cover);
  if (cv::countNonZero(meets) == 0)
    return run.nothing_to_judge("edge_…", "a part in camera 0's image that is half on, half off the surface");
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < run.check().renderer_input.rig.projectors.size(); ++i)
    images.push_back(run.renderer().projector_image(i, run.check().renderer_input.posed, *camera));
  const cv::Mat by_light =
      srgb_image(ReferenceView(run.world(), true_camera, k_finer).rendered_light(images));
  const cv::Mat together =
      run.renderer().composite(0, by_light, run.check().renderer_input.posed, projector::Composite::rest);
  const cv::Mat expected = srgb_image(parts.light), gap = missing_luminance(expected, together),
                twice = missing_luminance(together, expected);
  run.set("edge_gap_share", p95_within(gap, meets));
  run.set("edge_double_share", p95_within(twice, meets));
  cv::Mat levels, shown = together / 4;
  cv::Mat(cv::max(gap, twice)).convertTo(levels, CV_8U, 255 / 0.5);
  bgr_image(levels).copyTo(shown, meets);
  run.add({"edge", "Where light meets screen at " + camera->name,
           fmt::format("{} pixels; 95 % quantile: {:.1f} % of the light missing, {:.1f} % shown twice. "
                       "Difference: at these pixels, white is 50 % or more.",
                       cv::countNonZero(meets), 100 * run.value("edge_gap_share"),
                       100 * run.value("edge_double_share")),
           together, expected, shown});
  return {};
}

Status judge_depth_order(CheckRun& run) {
  LIMN_TRY(const Imager* camera, run.camera("depth_order_share"));
  const cv::Mat found = front_of(run.renderer().coverage(run.check().renderer_input.posed, *camera), *camera);
  const sim::DepthOrder truth = run.reference().depth_order(run.world().rig.cameras.front());
  const int contested = cv::countNonZero(truth.contested);
  if (contested == 0)
    return run.nothing_to_judge("depth_order_share", "a part before or behind something in camera 0's image");
  run.set("depth_order_share", share_within(found == truth.front, truth.contested));
  cv::Mat actual = owner_shades(found), expected = owner_shades(truth.front);
  actual.setTo(30, truth.contested & (found < 0));
  expected.setTo(30, truth.contested & (truth.front < 0));
  run.add({"depth-order", "What is in front at " + camera->name,
           fmt::format("{} pixels see a part and something else. Dark grey: the prototype is in front of "
                       "a part. Difference: red.",
                       contested),
           bgr_image(actual), bgr_image(expected), label_difference(actual, expected)});
  return {};
}

}  // namespace limn::validate
