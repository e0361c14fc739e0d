#include "apps/live/shadow_watch.h"

#include <algorithm>

namespace limn::apps {
namespace {

constexpr int k_patch_px = 8;
constexpr std::size_t k_most_shown = 30;  // pictures between paint and their light in a frame: a second's
// The prototype's jitter, below which patches stay where they are.
constexpr double k_moved_m = 0.5e-3, k_moved_rad = 1e-3;

bool has_moved(const Pose& from, const Pose& to) {
  return (from.translation - to.translation).norm() > k_moved_m ||
         angle_between(from.rotation, to.rotation) > k_moved_rad;
}

}  // namespace

ShadowWatch::ShadowWatch(const Rig& rig) : rig_(rig), arriving_(rig), seen_at_(rig.cameras.size()) {}

void ShadowWatch::look(const Watched& watched,
                       const scene::PosedScene& posed,
                       projector::Renderer* renderer) {
  if (!posed.world_from_prototype) return;
  if (!placed_ || has_moved(*placed_, *posed.world_from_prototype)) {
    placed_ = posed.world_from_prototype;
    for (std::size_t i = 0; i < rig_.cameras.size(); ++i)
      arriving_.place(i, renderer->lit_patches(i, posed, k_patch_px));
  }
  bool has_changed = false;
  for (std::size_t i = 0; i < watched.frames.size(); ++i) {
    const Frame& frame = watched.frames[i];
    if (frame.image.empty() || frame.captured_at <= seen_at_[i]) continue;
    seen_at_[i] = frame.captured_at;
    if (const auto* pictures = shown_at(frame.captured_at))
      has_changed |= arriving_.see(i, frame.image, *pictures);
  }
  if (!has_changed) return;
  for (std::size_t i = 0; i < rig_.projectors.size(); ++i) renderer->set_arriving(i, arriving_.map(i));
}

void ShadowWatch::showed(const std::vector<cv::Mat>& pictures, Stamp shown_at) {
  shown_.push_back({{}, shown_at});
  for (const cv::Mat& picture : pictures) shown_.back().pictures.push_back(picture.clone());
  if (shown_.size() > k_most_shown) shown_.pop_front();
}

// What lit a frame; null when that is not known.
const std::vector<cv::Mat>* ShadowWatch::shown_at(Stamp at) const {
  const auto later = std::find_if(shown_.begin(), shown_.end(), [&](const Shown& s) { return s.at > at; });
  return later == shown_.begin() ? nullptr : &std::prev(later)->pictures;
}

}  // namespace limn::apps
