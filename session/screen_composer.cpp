#include "session/screen_composer.h"

#include <algorithm>

#include "core/screen_encoding.h"
#include "session/grid_and_split.h"
#include "session/stillness.h"

namespace limn::session {
namespace {

const cv::Scalar k_background(40, 36, 34);  // background of rendered views: a dark room

Imager moved_eye(Imager imager, double right_m) {
  imager.imager_from_world.translation.x() -= right_m;
  return imager;
}

}  // namespace

ScreenComposer::ScreenComposer(const scene::Scene* scene,
                               const Rig* rig,
                               const ComposeOptions& options,
                               const Eigen::AlignedBox3d& prototype_box,
                               const scene::PartBoxes* part_boxes)
    : scene_(scene), rig_(rig), options_(options), prototype_box_(prototype_box), part_boxes_(part_boxes) {}

cv::Mat ScreenComposer::image(const ScreenInput& input, scene::Screen what, projector::Renderer* renderer) {
  using enum scene::Screen;
  if (what == off || input.frame.image.empty()) return {};
  const cv::Mat behind = options_.is_linear_camera ? srgb_image(input.frame.image) : input.frame.image;
  if (what == camera) return behind;
  const Stamp at = input.frame.captured_at;
  scene::PosedScene posed = scene::compose_scene(*scene_, input.show_state, input.tracks);
  keep_parts_still(input.shown, *part_boxes_, &posed);
  if (what == rest) {
    const double seconds = treated_at_ == Stamp{} ? 0 : std::max(0.0, seconds_between(treated_at_, at));
    policies_ = projector::updated_policies(policies_, renderer->coverage(posed, screen_camera()), seconds);
    treated_at_ = at;
  }
  const Imager viewer = input.viewer.width > 0 ? input.viewer : screen_camera();
  const cv::Mat image = composed(behind, posed, viewer, what, policies_, renderer);
  const auto left = scene::left_of_split(*scene_, input.show_state);
  if (!left || what == stereo) return image;
  const auto line =
      split_line(what == view ? viewer : screen_camera(), posed, prototype_box_, input.show_state.split_mm);
  if (!line) return image;
  const scene::PosedScene other = scene::compose_scene(*scene_, *left, input.tracks);
  const auto policies = what == rest
                            ? projector::updated_policies({}, renderer->coverage(other, screen_camera()), 0)
                            : std::vector<projector::CompositePolicy>();
  return split_along(*line, composed(behind, other, viewer, what, policies, renderer), image);
}

cv::Mat ScreenComposer::composed(const cv::Mat& behind,
                                 const scene::PosedScene& posed,
                                 const Imager& viewer,
                                 scene::Screen what,
                                 std::span<const projector::CompositePolicy> policies,
                                 projector::Renderer* renderer) const {
  if (what == scene::Screen::full)
    return renderer->composite(rig_->first_visible_camera(), behind, posed, projector::Composite::full);
  if (what == scene::Screen::rest)
    return renderer->composite(rig_->first_visible_camera(), behind, posed, policies);
  if (what == scene::Screen::view) return renderer->view(viewer, posed, k_background);
  const double half = 0.5e-3 * options_.stereo_mm;
  const cv::Mat eyes[2] = {renderer->view(moved_eye(viewer, -half), posed, k_background),
                           renderer->view(moved_eye(viewer, half), posed, k_background)};
  cv::Mat both;
  cv::hconcat(eyes, 2, both);
  return both;
}

}  // namespace limn::session
