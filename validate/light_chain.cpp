#include "validate/light_chain.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "projector/renderer.h"
#include "tracker/body_estimate.h"
#include "tracker/marker_pose.h"

namespace limn::validate {
namespace {

constexpr int k_judged_points = 2500;
constexpr std::uint64_t k_judged_seed = 20261121;

// A renderer of the target dots instead of the scene's parts, on the same prototype.
Result<projector::Renderer> dots_renderer(scene::Scene scene, const Rig& rig, const TargetDots& dots) {
  scene::Slot slot;
  slot.name = "dots";
  slot.mode = scene::Mode::surface;
  slot.variants = {{"dots", dots.mesh}};
  scene.slots = {slot};
  return projector::Renderer::create(scene, rig);
}

double marker_size_m(std::span<const Body> bodies, const MarkerName& marker) {
  for (const Body& body : bodies)
    for (const BodyMarker& on_body : body.markers)
      if (on_body.marker == marker) return on_body.size_m;
  return 0;
}

// The detections with the true corners of their markers; without those that are not in the world.
std::vector<tracker::Detection> with_true_corners(std::span<const tracker::Detection> detections,
                                                  std::span<const Body> bodies,
                                                  const sim::World& world) {
  std::vector<tracker::Detection> exact;
  for (tracker::Detection detection : detections) {
    const auto world_from_marker = sim::world_from_marker(world, detection.marker);
    const double size_m = marker_size_m(bodies, detection.marker);
    if (!world_from_marker || size_m <= 0) continue;
    const auto corners = tracker::square_corners(size_m);
    bool seen = true;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const auto px = world.rig.cameras.at(0).project(*world_from_marker * corners[i]);
      seen &= px.has_value();
      if (px) detection.corners_px[i] = *px;
    }
    if (seen) exact.push_back(detection);
  }
  return exact;
}

// The prototype's place according to these detections in the rig's camera 0.
Result<Pose> place_of_prototype(const Rig& rig,
                                const scene::Scene& scene,
                                std::span<const Body> bodies,
                                std::span<const tracker::Detection> detections) {
  const tracker::View view{&rig.cameras.at(0), detections};
  const auto tracks = tracker::observed(bodies, std::span(&view, 1), {});
  const auto posed = scene::posed(scene, tracks);
  if (!posed.world_from_prototype)
    return error("the demo: expected markers of the prototype, found none that place it.");
  return *posed.world_from_prototype;
}

}  // namespace

TargetDots dots_on_prototype(const sim::World& world) {
  return target_dots(world, k_judged_points, k_judged_seed);
}

Result<Registration> judge_light(const scene::Scene& scene,
                                 const Rig& rig,
                                 const sim::World& world,
                                 const TargetDots& dots,
                                 const Pose& world_from_prototype) {
  LIMN_TRY(projector::Renderer renderer, dots_renderer(scene, rig, dots));
  const scene::PosedScene posed{world_from_prototype, {{"dots", "dots", world_from_prototype}}};
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < rig.projectors.size(); ++i)
    images.push_back(renderer.projector_image(i, posed, rig.cameras.at(0)));
  return judged_registration(world, dots, images);
}

Result<LightChain> light_chain(const scene::Scene& scene,
                               const Rig& calibrated,
                               const sim::World& world,
                               const TargetDots& dots,
                               std::span<const Body> bodies,
                               std::span<const tracker::Detection> detections) {
  const auto error_mm = [&](const Rig& rig, const Pose& world_from_prototype) -> Result<double> {
    LIMN_TRY(const Registration judged, judge_light(scene, rig, world, dots, world_from_prototype));
    return judged.rms_mm;
  };
  const auto exact = with_true_corners(detections, bodies, world);
  LIMN_TRY(const Pose by_exact, place_of_prototype(world.rig, scene, bodies, exact));
  LIMN_TRY(const Pose by_found, place_of_prototype(world.rig, scene, bodies, detections));
  LIMN_TRY(const Pose by_calibrated, place_of_prototype(calibrated, scene, bodies, exact));
  LightChain chain;
  LIMN_TRY(chain.rendering_mm, error_mm(world.rig, world.world_from_prototype));
  LIMN_TRY(chain.prototype_pose_mm, error_mm(world.rig, by_exact));
  LIMN_TRY(chain.marker_corners_mm, error_mm(world.rig, by_found));
  LIMN_TRY(chain.calibration_mm, error_mm(calibrated, by_calibrated));
  return chain;
}

}  // namespace limn::validate
