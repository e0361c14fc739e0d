#include <opencv2/core.hpp>

#include "validate/check_measures.h"
#include "validate/metrics.h"

namespace limn::validate {

Status judge_rerun(CheckRun& run) {
  LIMN_TRY(projector::Renderer again,
           projector::Renderer::create(run.check().renderer_input.scene, run.check().renderer_input.rig));
  auto first = run.projector_images();
  auto second = run.projector_images_by(again, run.check().renderer_input.posed);
  if (!run.check().renderer_input.rig.cameras.empty()) {
    const Imager& camera = run.check().renderer_input.rig.cameras.front();
    const cv::Mat black(camera.height, camera.width, CV_8UC3, cv::Scalar::all(0));
    first.push_back(
        run.renderer().composite(0, black, run.check().renderer_input.posed, projector::Composite::full));
    second.push_back(again.composite(0, black, run.check().renderer_input.posed, projector::Composite::full));
  }
  run.set("rerun_worst_255", worst_difference(first, second));
  return {};
}

}  // namespace limn::validate
