#include "validate/reference_view.h"

#include <opencv2/imgproc.hpp>

#include "sim/sensor_model.h"

namespace limn::validate {

cv::Mat binned(const cv::Mat& fine, int factor) {
  cv::Mat out;
  cv::resize(fine, out, {fine.cols / factor, fine.rows / factor}, 0, 0, cv::INTER_AREA);
  return out;
}

ReferenceView::ReferenceView(const sim::World& world_in, const Imager& viewer, int rays)
    : finer(rays), world(world_in) {
  world.rig.cameras = {resized(viewer, rays * viewer.width, rays * viewer.height).value()};
  world.camera_effects = {sim::CameraEffects{.colour = true}};
  samples = sim::trace(world, 0);
}

cv::Mat ReferenceView::rendered_light(const sim::World& projectors, const std::vector<cv::Mat>& shown) const {
  return binned(sim::ideal_light(projectors, samples, shown), finer);
}

cv::Mat ReferenceView::rendered_light(std::size_t projector, const cv::Mat& shown) const {
  std::vector<cv::Mat> all(world.rig.projectors.size());
  all[projector] = shown;
  return rendered_light(all);
}

std::vector<cv::Mat> ReferenceView::reaches() const {
  std::vector<cv::Mat> reaches;
  for (std::size_t i = 0; i < world.rig.projectors.size(); ++i) {
    const Imager& projector = world.rig.projectors[i];
    const cv::Mat white(projector.height, projector.width, CV_32FC3, cv::Scalar::all(1));
    cv::Mat reach;
    cv::extractChannel(rendered_light(i, white), reach, 1);
    reaches.push_back(reach);
  }
  return reaches;
}

}  // namespace limn::validate
