#include "session/shadow_watch.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "session/stillness.h"

namespace limn::session {
namespace {

constexpr int k_patch_px = 8;

}  // namespace

ShadowWatch::ShadowWatch(const Rig& rig) : rig_(rig), arriving_(rig), seen_at_(rig.cameras.size()) {}

void ShadowWatch::update(const Percepts& percepts,
                         const scene::PosedScene& posed,
                         const ProjectionHistory& shown,
                         projector::Renderer* renderer) {
  if (!posed.world_from_prototype) return;
  if (!placed_ || is_elsewhere(*placed_, *posed.world_from_prototype)) {
    placed_ = posed.world_from_prototype;
    for (std::size_t i = 0; i < rig_.cameras.size(); ++i)
      arriving_.place(i, renderer->illuminated_patches(i, posed, k_patch_px));
  }
  bool has_changed = false;
  for (std::size_t i = 0; i < percepts.frames.size(); ++i) {
    const Frame& frame = percepts.frames[i];
    if (frame.image.empty() || frame.captured_at <= seen_at_[i]) continue;
    if (rig_.cameras[i].sees != Spectrum::visible) continue;  // it sees no projected light
    seen_at_[i] = frame.captured_at;
    if (const auto* images = shown.at(frame.captured_at))
      has_changed |= arriving_.update_maps(i, frame.image, *images);
  }
  if (!has_changed) return;
  maps_.resize(rig_.projectors.size());
  for (std::size_t i = 0; i < maps_.size(); ++i) {
    const cv::Mat& share = arriving_.map(i);
    const bool is_all = cv::countNonZero(share < 1 - 0.5 / 255) == 0;
    maps_[i] = cv::Mat();
    if (!is_all) share.convertTo(maps_[i], CV_8U, 255);
  }
}

}  // namespace limn::session
