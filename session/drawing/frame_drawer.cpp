#include "session/drawing/frame_drawer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>

namespace limn::session {
namespace {

constexpr double k_fading_gamma = 2.2;  // accurate enough to mix fading images

// base + share * (with - base), in linear light.
cv::Mat mixed(const cv::Mat& base, const cv::Mat& with, double share) {
  std::array<float, 256> light{};
  for (int i = 0; i < 256; ++i)
    light[static_cast<std::size_t>(i)] = static_cast<float>(std::pow(i / 255.0, k_fading_gamma));
  cv::Mat out(base.size(), base.type());
  const auto bytes = [](const cv::Mat& m, int row) { return m.ptr<std::uint8_t>(row); };
  for (int row = 0; row < base.rows; ++row) {
    const std::uint8_t *a = bytes(base, row), *b = bytes(with, row);
    std::uint8_t* c = out.ptr<std::uint8_t>(row);
    for (int i = 0; i < 3 * base.cols; ++i) {
      if (a[i] == b[i]) {
        c[i] = a[i];
        continue;
      }
      const double sum = light[a[i]] + share * (light[b[i]] - light[a[i]]);
      c[i] = cv::saturate_cast<std::uint8_t>(255 * std::pow(sum, 1 / k_fading_gamma));
    }
  }
  return out;
}

// Both are CV_8UC1 or empty.
bool is_same_map(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size()) return false;
  for (int row = 0; row < a.rows; ++row)
    if (std::memcmp(a.ptr(row), b.ptr(row), static_cast<std::size_t>(a.cols)) != 0) return false;
  return true;
}

}  // namespace

Result<FrameDrawer> FrameDrawer::create(const scene::Scene* scene,
                                        const Rig* rig,
                                        const DrawOptions& options) {
  LIMN_TRY(projector::Renderer renderer, projector::Renderer::create(*scene, *rig));
  return FrameDrawer(scene, rig, options, std::move(renderer));
}

FrameDrawer::FrameDrawer(const scene::Scene* scene,
                         const Rig* rig,
                         const DrawOptions& options,
                         projector::Renderer renderer)
    : scene_(scene),
      rig_(rig),
      options_(options),
      renderer_(std::move(renderer)),
      bodies_(scene::bodies(*scene)),
      constellations_(scene::constellations(*scene)),
      to_prepare_(options.prepares_lines ? 2 : 0),
      has_infrared_(std::ranges::count(rig->cameras, Spectrum::infrared, &Imager::sees) > 0),
      arriving_(rig->projectors.size()) {}

// Draws: parts, overlays on the surface, no light on markers, signs beside markers.
EyeImages FrameDrawer::image(const FrameDescription& frame, std::size_t projector) {
  apply_arriving_light(frame.arriving);
  use_deviation(frame.deviation);
  renderer_.set_quick_motion(frame.is_moving);
  if (to_prepare_ > 0 && frame.posed.world_from_prototype && !frame.is_black) prepare_lines(frame, projector);
  const std::string& name = rig_->projectors[projector].name;
  if (std::ranges::count(options_.stereo_projectors, name) == 0)
    return {drawn(frame, projector, frame.viewer)};
  const auto both = limn::eyes(frame.viewer, 1e-3 * options_.stereo_mm);
  return {drawn(frame, projector, both[0]), drawn(frame, projector, both[1])};
}

// Draws lines that nobody sees, on sides of the prototype's triangles, and then half of them: a change of
// lines alone uses further programs. Drivers compile a program when it has something to draw.
void FrameDrawer::prepare_lines(const FrameDescription& frame, std::size_t projector) {
  constexpr std::size_t k_lines = 32;
  --to_prepare_;
  const scene::Mesh& mesh = scene_->prototype->mesh;
  if (mesh.triangles.empty()) return;
  scene::PosedScene with_lines = frame.posed;
  for (std::size_t i = 0; i < k_lines; ++i) {
    const auto& triangle = mesh.triangles[i * mesh.triangles.size() / k_lines];
    scene::DrawnLine& line = with_lines.drawn.emplace_back();
    line.name = "prepared " + std::to_string(i);
    line.curve.points.resize(2);
    for (std::size_t k = 0; k < 2; ++k) line.curve.points[k].p = mesh.positions[triangle[k]].cast<double>();
  }
  renderer_.projector_image(projector, with_lines, frame.viewer);
  with_lines.drawn.resize(with_lines.drawn.size() - k_lines / 2);
  renderer_.projector_image(projector, with_lines, frame.viewer);
}

void FrameDrawer::apply_arriving_light(const std::vector<cv::Mat>& maps) {
  for (std::size_t i = 0; i < arriving_.size(); ++i) {
    const cv::Mat map = i < maps.size() ? maps[i] : cv::Mat();
    if (is_same_map(map, arriving_[i])) continue;
    arriving_[i] = map.clone();
    renderer_.set_occlusion(i, map);
  }
}

void FrameDrawer::use_deviation(const std::shared_ptr<const scene::DeviationLayer>& layer) {
  if (!layer || layer == deviation_) return;
  deviation_ = layer;
  renderer_.set_deviation(*layer);
}

cv::Mat FrameDrawer::drawn(const FrameDescription& frame, std::size_t projector, const Imager& eye) {
  const Imager& imager = rig_->projectors[projector];
  if (frame.is_black) return cv::Mat(imager.height, imager.width, CV_8UC3, cv::Scalar::all(0));
  cv::Mat image = faded_image(frame, projector, eye);
  const auto target = [&] {
    return projector::OverlayTarget{projector, imager, frame.posed, &image, &renderer_, &eye};
  };
  draw(frame.on_surface, target());
  image = with_marker_light(image, frame, projector);
  draw(frame.signs, target());
  return image;
}

cv::Mat FrameDrawer::faded_image(const FrameDescription& frame, std::size_t projector, const Imager& eye) {
  cv::Mat image = renderer_.projector_image(projector, frame.posed, eye);
  for (const FadingScene& gone : frame.gone)
    image = mixed(image, renderer_.projector_image(projector, gone.posed, eye), gone.share);
  for (const FadingPart& fading : frame.fading) {
    scene::PosedScene with = frame.posed;
    with.parts.push_back(fading.part);
    image = mixed(image, renderer_.projector_image(projector, with, eye), fading.share);
  }
  return image;
}

cv::Mat FrameDrawer::with_marker_light(const cv::Mat& image,
                                       const FrameDescription& frame,
                                       std::size_t projector) const {
  if (options_.marker_light == tracker::MarkerLight::as_is) return image;
  std::vector<Body> bodies = bodies_;
  for (const MarkerName& marker : frame.loose)
    bodies.push_back({scene::loose_body(marker), {{marker, scene::first_marker_size_m(*scene_), Pose()}}});
  const std::vector<Track> tracks =
      has_infrared_ ? tracker::seen_in_visible_light(rig_->cameras, bodies, constellations_, frame.tracks)
                    : frame.tracks;
  return tracker::with_marker_light(image, mask_of(projector, bodies, tracks), options_.marker_light);
}

cv::Mat FrameDrawer::carrier_mask(std::size_t projector, std::span<const Track> tracks) const {
  return mask_of(projector, bodies_, tracks);
}

cv::Mat FrameDrawer::mask_of(std::size_t projector,
                             std::span<const Body> bodies,
                             std::span<const Track> tracks) const {
  const Imager& imager = rig_->projectors[projector];
  cv::Mat mask = tracker::marker_mask(imager, bodies, tracks);
  if (!constellations_.empty()) mask |= tracker::ball_mask(imager, constellations_, tracks);
  return mask;
}

}  // namespace limn::session
