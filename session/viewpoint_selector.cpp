#include "session/viewpoint_selector.h"

#include <algorithm>
#include <cmath>

namespace limn::session {
namespace {

constexpr double k_glide_s = 0.1;  // after this time a third of the way to a guest's new position remains
constexpr const char* k_still_eye = "the scene's own";

// The name of a guest's viewpoint among the viewers'.
std::string guest_eye(const std::string& guest) { return "guest " + guest; }

}  // namespace

ViewpointSelector::ViewpointSelector(const scene::Scene* scene, const Rig* rig)
    : scene_(scene),
      rig_(rig),
      d_up_world_(rig->cameras.empty()
                      ? Eigen::Vector3d(0, -1, 0)
                      : rig->cameras[0].imager_from_world.rotation.inverse() * Eigen::Vector3d(0, -1, 0)) {}

const SelectedViewpoint& ViewpointSelector::select(const scene::PosedScene& posed, const FrameInput& input) {
  std::vector<scene::Viewpoint> guests = guests_eyes(input);
  const bool is_followed = guests.size() == 1 && guests[0].viewer == guest_eye(input.show_state.viewer);
  selected_.follows = is_followed ? input.show_state.viewer : "";
  selected_.p_guest_eye_world.reset();
  selected_.viewer = viewer_for(posed, std::move(guests), input.times.shown_at);
  return selected_;
}

// The scene's own viewer if it never moves: its only viewer if that is fixed, or the first camera if there
// are no viewers. Null: viewers move, or share a viewpoint.
const Imager* ViewpointSelector::still_viewer() const {
  if (scene_->viewers.size() == 1 && scene_->viewers[0].fixed) return &*scene_->viewers[0].fixed;
  return scene_->viewers.empty() ? &substitute_viewer() : nullptr;
}

// The viewpoint that is used until a viewer is seen.
const Imager& ViewpointSelector::substitute_viewer() const {
  return rig_->cameras.empty() ? rig_->projectors[0] : rig_->cameras[rig_->first_visible_camera()];
}

// Viewpoints of guests whose tablets have seen markers recently: only that of the followed guest, or else
// those of guests among the scene's viewers.
std::vector<scene::Viewpoint> ViewpointSelector::guests_eyes(const FrameInput& input) const {
  std::vector<scene::Viewpoint> eyes;
  const auto add = [&](const TabletViewpoint& place, double weight) {
    if (seconds_between(place.at, input.times.now) < k_guest_place_lasts_s)
      eyes.push_back({guest_eye(place.guest), place.p_eye_world, weight});
  };
  for (const TabletViewpoint& place : input.places)
    if (place.guest == input.show_state.viewer) add(place, 1);
  if (!eyes.empty()) return eyes;
  for (const TabletViewpoint& place : input.places)
    if (const scene::Viewer* viewer = scene_->find_tablet(place.guest)) add(place, viewer->weight);
  return eyes;
}

// A guest's position is known about ten times a second and is noisy, so it is smoothed over time.
void ViewpointSelector::move_smoothly(std::vector<scene::Viewpoint>* guests, double seconds) {
  const double step = 1 - std::exp(-seconds / k_glide_s);
  for (scene::Viewpoint& eye : *guests)
    for (const scene::Viewpoint& before : gliding_)
      if (before.viewer == eye.viewer) eye.p_world = before.p_world + step * (eye.p_world - before.p_world);
  gliding_ = *guests;
}

// The scene's own viewer if it stands still, otherwise an imager at the viewpoint that all viewers share and
// that moves smoothly. While a guest is followed, only that guest's viewpoint counts.
Imager ViewpointSelector::viewer_for(const scene::PosedScene& posed,
                                     std::vector<scene::Viewpoint> guests,
                                     Stamp at) {
  const Imager* still = still_viewer();
  is_away_ |= !guests.empty();
  if (still && !is_away_) return *still;
  const double seconds = eye_at_ == Stamp{} ? 0 : std::max(0.0, seconds_between(eye_at_, at));
  eye_at_ = std::max(eye_at_, at);
  move_smoothly(&guests, seconds);
  const auto p_middle = scene::middle_of(*scene_, posed);
  if (!p_middle) return selected_.viewer.width > 0 ? selected_.viewer : still ? *still : substitute_viewer();
  const scene::Viewpoint waiting{
      k_still_eye, (still ? *still : substitute_viewer()).imager_from_world.inverse().translation};
  std::vector<scene::Viewpoint> eyes = posed.viewpoints;
  if (still) eyes = {waiting};
  if (!selected_.follows.empty()) eyes.clear();
  eyes.insert(eyes.end(), guests.begin(), guests.end());
  if (shared_eye_.shares.empty() && (still || eyes.empty()))
    shared_eye_ = scene::updated_viewpoint({}, std::span(&waiting, 1), *p_middle, 0);
  shared_eye_ = scene::updated_viewpoint(shared_eye_, eyes, *p_middle, seconds);
  const bool is_back = guests.empty() && std::none_of(shared_eye_.shares.begin(), shared_eye_.shares.end(),
                                                      [](const auto& share) {
                                                        return share.viewer.empty();  // a viewer who is gone
                                                      });
  if (is_back) is_away_ = false;
  if (is_back && still) {
    shared_eye_ = {};
    eye_at_ = {};
    return *still;
  }
  const Eigen::Vector3d p_eye = *shared_eye_.p_world();
  if (is_away_) selected_.p_guest_eye_world = p_eye;
  if (shared_eye_.leader == k_still_eye && !still) return substitute_viewer();
  const auto viewer = scene::viewer_at(p_eye, *scene_, posed, d_up_world_);
  return viewer ? *viewer : still ? *still : substitute_viewer();
}

}  // namespace limn::session
