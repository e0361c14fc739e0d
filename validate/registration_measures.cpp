#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "scene/meshes/scan_preview.h"
#include "validate/check_images.h"
#include "validate/check_measures.h"
#include "validate/metrics.h"

namespace limn::validate {
namespace {

constexpr int k_dot_count = 600;
constexpr std::uint64_t k_dot_seed = 20261121;
constexpr double k_off_surface_m = 0.05;

void add_dots(CheckRun& run,
              const std::string& file,
              const std::string& title,
              const cv::Mat& light,
              const Imager& viewer,
              const Registration& found,
              const std::vector<Eigen::Vector3d>& places,
              const std::string& remark) {
  const cv::Mat actual = srgb_image(light);
  cv::Mat expected = bgr_image(cv::Mat(actual.size(), CV_8U, cv::Scalar(0))), difference = actual / 4;
  const double worst_mm = run.value(file + "_mm");
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto px = viewer.project(run.world().world_from_prototype * places[i]);
    if (!px) continue;
    const cv::Point at(cvRound(px->x()), cvRound(px->y()));
    cv::circle(expected, at, 2, cv::Scalar::all(255), cv::FILLED, cv::LINE_AA);
    const auto colour =
        scene::signed_colour_rgb(std::min(1.0, found.errors_mm[i] / std::max(worst_mm, 1e-9)));
    cv::circle(difference, at, 4, cv::Scalar(colour[2], colour[1], colour[0]), cv::FILLED, cv::LINE_AA);
  }
  run.add({file, title,
           fmt::format(
               "{} discs; RMS {:.3f} mm, 95 % quantile {:.3f} mm, unlit {}.{} Difference: red is {:.3f} mm.",
               found.points, found.rms_mm, found.p95_mm, found.unlit, remark, worst_mm),
           actual, expected, difference});
}

void add_dots(CheckRun& run,
              const std::string& file,
              const std::string& title,
              const std::vector<cv::Mat>& images,
              const Registration& found,
              const std::vector<Eigen::Vector3d>& places) {
  add_dots(run, file, title, run.reference_view().rendered_light(images), run.check().viewer, found, places,
           "");
}

}  // namespace

Status judge_texture(CheckRun& run) {
  const TargetDots dots = target_dots(run.world(), k_dot_count, k_dot_seed);
  if (dots.p_targets.empty()) return run.nothing_to_judge("texture_mm", "a point that a projector reaches");
  LIMN_TRY(const auto images, run.projector_images_of(dots.mesh, scene::Mode::surface));
  const Registration found = judged_registration(run.world(), dots, images);
  run.set("texture_mm", found.rms_mm);
  add_dots(run, "texture", "Surface-locked light", images, found, dots.p_targets);
  return {};
}

Status judge_parallax(CheckRun& run) {
  const TargetDots dots =
      floating_dots(run.world(), run.check().viewer, k_off_surface_m, k_dot_count, k_dot_seed);
  if (dots.p_targets.empty())
    return run.nothing_to_judge("parallax_mm", "a point in front of which a disc is visible");
  LIMN_TRY(const auto images, run.projector_images_of(dots.mesh, scene::Mode::view));
  const Registration found = judged_registration(run.world(), dots, images);
  run.set("parallax_mm", *std::max_element(found.errors_mm.begin(), found.errors_mm.end()));
  add_dots(run, "parallax", "Points 50 mm off the surface", images, found, dots.p_centres);
  return {};
}

// The image is drawn for the first viewer.
Status judge_shared(CheckRun& run) {
  if (run.check().shares.empty()) return run.nothing_to_judge("shared_mm", "several viewers");
  TargetDots dots = floating_dots(run.world(), run.check().viewer, k_off_surface_m, k_dot_count, k_dot_seed);
  if (dots.p_targets.empty())
    return run.nothing_to_judge("shared_mm",
                                "a point in front of which a disc is visible from the shared viewpoint");
  LIMN_TRY(const auto images, run.projector_images_of(dots.mesh, scene::Mode::view));
  std::optional<Registration> first;
  std::string shares;
  double squares = 0;
  int viewers = 0;
  for (const scene::SharedViewpoint::Share& share : run.check().shares) {
    dots.p_viewpoint = run.world().world_from_prototype.inverse() * share.p_world;
    const Registration found = judged_registration(run.world(), dots, images);
    shares += fmt::format(" {}: {:.0f} % of the shared viewpoint, RMS {:.1f} mm.", share.viewer,
                          100 * share.share, found.rms_mm);
    if (!first) first = found;
    if (share.share <= 0) continue;
    squares += found.rms_mm * found.rms_mm;
    ++viewers;
  }
  run.set("shared_mm", std::sqrt(squares / viewers));
  Imager viewer = run.check().viewer;
  viewer.imager_from_world = looking_at(
      run.check().shares[0].p_world, *scene::middle_of(run.check().renderer_input.scene, run.check().posed),
      Eigen::Vector3d::UnitZ());
  const ReferenceView first_view(run.world(), viewer, 1);
  add_dots(run, "shared", "Points 50 mm off the surface, as " + run.check().shares[0].viewer + " sees them",
           first_view.rendered_light(images), viewer, *first, dots.p_centres, shares);
  return {};
}

}  // namespace limn::validate
