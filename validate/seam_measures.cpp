#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <string>

#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "validate/check_images.h"
#include "validate/check_measures.h"
#include "validate/reference_view.h"

namespace limn::validate {
namespace {

constexpr int k_seam_window = 9;  // viewer pixels, the window of a step
// 70 degrees. At larger angles a projector's pixel is stretched threefold.
constexpr double k_min_seam_cosine = 0.34;
// Viewer pixels. Within 4 of where light ends it fades: over the last projector pixel, about 3 viewer pixels
// wide at 70 degrees, and the viewer's blur.
constexpr int k_light_end = 9;

Eigen::Vector3f p_projector(const CheckRun& run, std::size_t i) {
  return run.world().rig.projectors[i].imager_from_world.inverse().translation.cast<float>();
}

// The mean light of the projectors' black in the viewer's pixels, as if each projector reached everything
// that faces it (CV_32FC3).
cv::Mat mean_black(CheckRun& run, const sim::World& glowing) {
  const sim::Samples& samples = run.fine_reference_view().samples;
  cv::Mat light(samples.height, samples.width, CV_32FC3, cv::Scalar::all(0));
  const std::size_t projectors = glowing.rig.projectors.size();
  for (std::size_t i = 0; i < projectors; ++i) {
    const auto black =
        static_cast<float>(glowing.projector_effects[i].black_level / static_cast<double>(projectors));
    for (std::size_t k = 0; k < light.total(); ++k) {
      if (samples.object[k] < 0) continue;
      const Eigen::Vector3f towards = p_projector(run, i) - samples.p_world[k];
      const float cosine = samples.n_world[k].dot(towards.normalized());
      light.at<cv::Vec3f>(static_cast<int>(k)) +=
          cv::Vec3f::all(black * std::max(0.0F, cosine) / towards.squaredNorm());
    }
  }
  return binned(light, k_finer);
}

// The response as limn solve would measure it.
ProjectorResponse measured_response(const sim::ProjectorEffects& effects, const std::string& projector) {
  ProjectorResponse response;
  response.projector = projector;
  for (int value = 0; value < 256; ++value)
    response.green.push_back(sim::light_share(effects, 1, value / 255.0));
  response.red = response.blue = response.green;
  response.black_level = Measurement{effects.black_level, 0};
  return response;
}

// Mask of the pixels that the projectors can light evenly: one of them reaches the whole pixel at no grazing
// angle, away from where all light ends.
cv::Mat even_light_mask(CheckRun& run) {
  const sim::Samples& samples = run.fine_reference_view().samples;
  cv::Mat mask(run.check().viewer.height, run.check().viewer.width, CV_8U, cv::Scalar(0));
  for (std::size_t i = 0; i < run.fine_reaches().size(); ++i) {
    const Eigen::Vector3f p_light = p_projector(run, i);
    cv::Mat steep(samples.height, samples.width, CV_32F, cv::Scalar(0));
    for (std::size_t k = 0; k < steep.total(); ++k)
      if (samples.n_world[k].dot((p_light - samples.p_world[k]).normalized()) > k_min_seam_cosine)
        steep.at<float>(static_cast<int>(k)) = 1;
    mask |= (run.fine_reaches()[i] > k_whole) & (binned(steep, k_finer) > k_whole);
  }
  cv::erode(mask, mask, square_kernel(k_light_end));
  return mask;
}

// The variation of luminance around each pixel of `whole` as a share of `unit`, and the lines where another
// set of projectors begins.
struct Steps {
  cv::Mat step;   // CV_32F
  cv::Mat along;  // CV_8U
  double p95_along = 0, worst_along = 0, worst = 0;
};

Steps steps_of(CheckRun& run, const cv::Mat& light, double unit, const cv::Mat& whole) {
  cv::Mat ratio, weight;
  cv::transform(light, ratio, cv::Matx13f(0.0722F, 0.7152F, 0.2126F) * static_cast<float>(1 / unit));
  whole.convertTo(weight, CV_32F, 1.0 / 255);
  ratio = ratio.mul(weight);
  cv::GaussianBlur(ratio, ratio, {0, 0}, k_seam_blur_px);
  cv::GaussianBlur(weight, weight, {0, 0}, k_seam_blur_px);
  ratio /= cv::max(weight, 1e-6);
  const cv::Mat window = square_kernel(k_seam_window);
  const auto range = [&](const cv::Mat& values) {
    cv::Mat highest = values.clone(), lowest = values.clone();
    highest.setTo(-1e9, ~whole);
    lowest.setTo(1e9, ~whole);
    cv::dilate(highest, highest, window);
    cv::erode(lowest, lowest, window);
    cv::Mat difference = highest - lowest;
    difference.setTo(0, ~whole);
    return difference;
  };
  Steps steps{range(ratio), cv::Mat(light.size(), CV_8U, cv::Scalar(0))};
  for (const cv::Mat& reach : run.fine_reaches()) {
    cv::Mat reached;
    cv::Mat(reach > 0.5).convertTo(reached, CV_32F);
    steps.along |= range(reached) > 0;
  }
  cv::minMaxLoc(steps.step, nullptr, &steps.worst);
  cv::minMaxLoc(steps.step, nullptr, &steps.worst_along, nullptr, nullptr, steps.along);
  steps.p95_along = p95_within(steps.step, steps.along);
  return steps;
}

cv::Mat steps_image(const Steps& steps, double white) {
  cv::Mat seams(steps.step.size(), CV_8UC3, cv::Scalar::all(0)), grey;
  seams.setTo(cv::Scalar(90, 70, 40), steps.along);
  steps.step.convertTo(grey, CV_8U, 255 / white);
  return cv::max(seams, bgr_image(grey));
}

}  // namespace

Status judge_seams(CheckRun& run) {
  LIMN_TRY(const auto images, run.projector_images_of(run.coat(), scene::Mode::surface));
  const cv::Mat actual = run.fine_reference_view().rendered_light(images);
  const cv::Mat whole = even_light_mask(run);
  const Steps steps = steps_of(run, actual, k_coat, whole);
  if (cv::countNonZero(steps.along) == 0)
    return run.nothing_to_judge("seam_step_…", "a seam of projectors in the viewer's image");
  run.set("seam_step_p95", steps.p95_along);
  run.set("seam_step_max", steps.worst);
  cv::Mat expected(actual.size(), CV_32FC3, cv::Scalar::all(0));
  expected.setTo(cv::Scalar::all(k_coat), whole);
  run.add({"seam", "An even coat of light, from the viewpoint",
           fmt::format("Steps along seams: 95 % quantile {:.2f} %; worst anywhere {:.2f} %. Difference: "
                       "seams are blue, white is a step of 8 % or more.",
                       100 * steps.p95_along, 100 * steps.worst),
           srgb_image(actual), srgb_image(expected), steps_image(steps, 0.08)});
  return {};
}

// Where nothing is shown, all projectors show black and their light adds up. Distance and incidence are
// simulated, because they decide how much black light arrives.
Status judge_black(CheckRun& run) {
  sim::World glowing = run.fine_reference_view().world;
  Rig rig = run.check().renderer_input.rig;
  for (std::size_t i = 0; i < glowing.projector_effects.size(); ++i) {
    sim::ProjectorEffects& effects = glowing.projector_effects[i];
    effects = {.illuminance_at_1m = 1,
               .gamma = k_projector_gamma,
               .black_level = run.check().truth.projector_effects[i].black_level};
    rig.responses.push_back(measured_response(effects, rig.projectors[i].name));
  }
  const cv::Mat whole = even_light_mask(run), one_black = mean_black(run, glowing);
  const double brightest = cv::mean(one_black, whole)[0];
  if (!(brightest > 0)) return run.nothing_to_judge("black_step_share", "projectors whose black gives light");
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(run.check().renderer_input.scene, rig));
  LIMN_TRY_STATUS(renderer.set_light({.even_black = true}));
  const auto images =
      run.projector_images_by(renderer, {run.check().renderer_input.posed.world_from_prototype, {}});
  const cv::Mat actual = run.fine_reference_view().rendered_light(glowing, images);
  const Steps steps = steps_of(run, actual / one_black, 1, whole);
  if (cv::countNonZero(steps.along) == 0)
    return run.nothing_to_judge("black_step_share", "a seam of projectors in the viewer's image");
  run.set("black_step_share", steps.worst_along);
  const double brightness = 0.1 / brightest;  // bright enough for people
  cv::Mat even = one_black * static_cast<double>(run.fine_reaches().size());
  even.setTo(0, ~whole);
  run.add({"black", "The light of black, brightened",
           fmt::format("Steps along seams: 95 % quantile {:.1f} %, worst {:.1f} % of one projector's black. "
                       "Difference: seams are blue, white is a step of 40 % or more.",
                       100 * steps.p95_along, 100 * steps.worst_along),
           srgb_image(actual * brightness), srgb_image(even * brightness), steps_image(steps, 0.4)});
  return {};
}

}  // namespace limn::validate
