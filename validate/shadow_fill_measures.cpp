#include <fmt/format.h>

#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "validate/check_images.h"
#include "validate/check_measures.h"
#include "validate/shadow_fill.h"

namespace limn::validate {

// Uses the true world with its room and noise.
Status judge_refill(CheckRun& run) {
  const auto [scene, posed] =
      run.check().renderer_input.posed.parts.empty()
          ? run.scene_with_mesh(run.coat(), scene::Mode::surface)
          : std::pair(run.check().renderer_input.scene, run.check().renderer_input.posed);
  const auto reading = measure_shadow_fill(run.check().truth, scene, posed, run.check().viewer,
                                           run.check().hand, run.check().truth.seed);
  if (!reading) return error("{}: {}", run.check().name, reading.message());
  run.set("refill_share", reading->share);
  run.set("refill_flash_share", reading->flash);
  run.set("refill_still_255", reading->still_levels);
  std::string shares;
  for (const ShadowFillFrame& frame : reading->frames)
    shares += fmt::format("{} {} {:.0f} %", shares.empty() ? "" : ",", frame.phase, 100 * frame.share);
  run.add({"refill", "Light with a hand in front of a projector",
           fmt::format("Expected: without the hand. Share of the shadow that is filled, frame by frame:{}. "
                       "Brighter by {:.1f} % at most. Difference: amplified 32 times.",
                       shares, 100 * reading->flash),
           srgb_image(reading->refilled), srgb_image(reading->before),
           amplified(cv::abs(reading->refilled - reading->before))});
  return {};
}

}  // namespace limn::validate
