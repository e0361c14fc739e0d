#include "session/screen_composer.h"

#include <algorithm>
#include <array>

#include "core/screen_encoding.h"
#include "projector/overlays/grid_and_split.h"
#include "session/stillness.h"

namespace limn::session {
namespace {

const cv::Scalar k_background(40, 36, 34);  // background of rendered views: a dark room

}  // namespace

ScreenComposer::ScreenComposer(const scene::Scene* scene,
                               const Rig* rig,
                               const ComposeOptions& options,
                               const Eigen::AlignedBox3d& prototype_box,
                               const scene::PartBoxes* part_boxes)
    : scene_(scene), rig_(rig), options_(options), prototype_box_(prototype_box), part_boxes_(part_boxes) {}

EyeImages ScreenComposer::images(const ScreenInput& input,
                                 const ScreenRequest& request,
                                 projector::Renderer* renderer) {
  using enum scene::Screen;
  if (request.what == off || input.cameras.size() <= screen_camera() ||
      input.cameras[screen_camera()].frame.image.empty())
    return {};
  const bool is_view = request.what == view || request.what == stereo;
  return is_view || (request.wall && request.what != camera) ? views(input, request, renderer)
                                                             : composites(input, request, renderer);
}

// Images of the cameras with the parts drawn over them.
EyeImages ScreenComposer::composites(const ScreenInput& input,
                                     const ScreenRequest& request,
                                     projector::Renderer* renderer) {
  std::array<std::size_t, 2> eyes{screen_camera(), screen_camera()};
  const auto has_image = [&](std::size_t camera) {
    return camera < input.cameras.size() && !input.cameras[camera].frame.image.empty();
  };
  const bool is_pair =
      request.for_two_eyes && stereo_cameras() &&
      std::all_of(stereo_cameras_->cameras().begin(), stereo_cameras_->cameras().end(), has_image);
  if (is_pair) eyes = stereo_cameras_->cameras();
  if (request.what == scene::Screen::rest) update_policies(input, eyes[0], renderer);
  EyeImages out{camera_image(input, eyes[0], request.what, renderer)};
  if (!is_pair) return out;
  out.right = camera_image(input, eyes[1], request.what, renderer);
  return stereo_cameras_->rectified(out);
}

// The prototype and the parts as the viewer sees them, also through a wall.
EyeImages ScreenComposer::views(const ScreenInput& input,
                                const ScreenRequest& request,
                                projector::Renderer* renderer) const {
  const Imager viewer = input.viewer.width > 0 ? input.viewer : rig_->cameras[screen_camera()];
  const auto seen_by = [&](const Imager& eye) -> std::optional<Imager> {
    if (!request.wall) return eye;
    return seen_through(*request.wall, eye.imager_from_world.inverse().translation, request.wall_pixels);
  };
  const bool is_pair = request.for_two_eyes || (request.what == scene::Screen::stereo && !request.wall);
  if (!is_pair) {
    const auto from = seen_by(viewer);
    if (!from) return {};
    const auto draw = [&](const scene::PosedScene& posed) {
      return renderer->view(*from, posed, k_background);
    };
    return {with_split(input, screen_camera(), *from, draw, draw)};
  }
  const scene::PosedScene posed = this->posed(input, screen_camera());
  const auto [left, right] = eyes(viewer, 1e-3 * options_.stereo_mm);
  const auto from_left = seen_by(left), from_right = seen_by(right);
  if (!from_left || !from_right) return {};
  EyeImages out{renderer->view(*from_left, posed, k_background),
                renderer->view(*from_right, posed, k_background)};
  if (!request.for_two_eyes) return {both(out)};
  return out;
}

cv::Mat ScreenComposer::camera_image(const ScreenInput& input,
                                     std::size_t camera,
                                     scene::Screen what,
                                     projector::Renderer* renderer) const {
  const cv::Mat& image = input.cameras[camera].frame.image;
  const cv::Mat behind = options_.is_linear_camera ? srgb_image(image) : image;
  if (what == scene::Screen::camera) return behind;
  const Imager& imager = rig_->cameras[camera];
  const auto full = [&](const scene::PosedScene& posed) {
    return renderer->composite(camera, behind, posed, projector::Composite::full);
  };
  if (what == scene::Screen::full) return with_split(input, camera, imager, full, full);
  return with_split(
      input, camera, imager,
      [&](const scene::PosedScene& posed) { return renderer->composite(camera, behind, posed, policies_); },
      [&](const scene::PosedScene& other) {
        const auto policies = projector::updated_policies({}, renderer->coverage(other, imager), 0);
        return renderer->composite(camera, behind, other, policies);
      });
}

void ScreenComposer::update_policies(const ScreenInput& input,
                                     std::size_t camera,
                                     projector::Renderer* renderer) {
  const Stamp at = input.cameras[camera].frame.captured_at;
  const double seconds = treated_at_ == Stamp{} ? 0 : std::max(0.0, seconds_between(treated_at_, at));
  policies_ = projector::updated_policies(
      policies_, renderer->coverage(posed(input, camera), rig_->cameras[camera]), seconds);
  treated_at_ = at;
}

scene::PosedScene ScreenComposer::posed(const ScreenInput& input, std::size_t camera) const {
  scene::PosedScene out = scene::compose_scene(*scene_, input.show_state, input.cameras[camera].tracks);
  keep_parts_still(input.shown, *part_boxes_, &out);
  return out;
}

// What `draw` draws; in a split view with the other look, drawn by `draw_other`, left of the line.
cv::Mat ScreenComposer::with_split(const ScreenInput& input,
                                   std::size_t camera,
                                   const Imager& seen_from,
                                   const Draw& draw,
                                   const Draw& draw_other) const {
  const scene::PosedScene posed = this->posed(input, camera);
  const cv::Mat image = draw(posed);
  const auto left = scene::left_of_split(*scene_, input.show_state);
  if (!left) return image;
  const auto line = projector::split_line(seen_from, posed, prototype_box_, input.show_state.split_mm);
  if (!line) return image;
  return projector::split_along(
      *line, draw_other(scene::compose_scene(*scene_, *left, input.cameras[camera].tracks)), image);
}

const std::optional<projector::StereoCameras>& ScreenComposer::stereo_cameras() {
  if (!has_looked_for_cameras_) stereo_cameras_ = projector::StereoCameras::chosen(*rig_);
  has_looked_for_cameras_ = true;
  return stereo_cameras_;
}

}  // namespace limn::session
