#pragma once

// A room that the renderer and the ray tracer both draw, and their comparison by the limits of `limn check`.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <utility>

#include "core/photometric_response.h"
#include "projector/composite_policy.h"
#include "sim/reference_renderer.h"
#include "tests/projector/sheet_room.h"

namespace limn::projector {

/// A scene at the origin of the world, and the same for the ray tracer.
struct JudgedRoom {
  Rig rig;
  Scene scene;
  PosedScene posed;
  Imager viewer;
  sim::World world;
};

inline JudgedRoom judged_room(Rig rig, Scene scene, const Vector3d& p_viewer = {-0.3, -0.3, -1.2}) {
  JudgedRoom room{std::move(rig), std::move(scene), {}, viewer_from(p_viewer), {}};
  room.posed = posed_at_origin(room.scene);
  room.world.rig = room.rig;
  room.world.scene = room.scene;
  sim::Object prototype;
  prototype.name = "prototype";
  prototype.mesh = std::make_shared<Mesh>(room.scene.prototype->mesh);
  room.world.objects = {prototype};
  return room;
}

/// The parts over black, as the room's camera sees them.
inline cv::Mat composite_over_black(Renderer* drawing, const JudgedRoom& room) {
  const Imager& camera = room.rig.cameras[0];
  return drawing->composite(0, cv::Mat::zeros(camera.height, camera.width, CV_8UC1), room.posed,
                            Composite::full);
}

/// Whether a picture agrees with the judge's where that covers whole pixels: the largest differences of the
/// channels have a mean of at most 1 level, and at most 0.5 % of them are over 4 levels. `gamma`: of the
/// picture's encoding; 0: sRGB. `least`: pixels that must be covered.
inline testing::AssertionResult agree(const cv::Mat& drawn,
                                      const sim::PartImage& judged,
                                      double gamma,
                                      int least) {
  int count = 0, far_off = 0;
  double sum = 0;
  for (int row = 0; row < drawn.rows; ++row)
    for (int column = 0; column < drawn.cols; ++column) {
      if (judged.cover.at<float>(row, column) < 1) continue;
      double worst = 0;
      for (int c = 0; c < 3; ++c) {
        const auto light =
            std::clamp(static_cast<double>(judged.light.at<cv::Vec3f>(row, column)[c]), 0.0, 1.0);
        const double wanted = 255 * (gamma > 0 ? std::pow(light, 1 / gamma) : srgb_from_linear(light));
        worst = std::max(worst, std::abs(drawn.at<cv::Vec3b>(row, column)[c] - wanted));
      }
      ++count;
      sum += worst;
      far_off += worst > 4;
    }
  const double mean = count > 0 ? sum / count : 255, share = count > 0 ? 1.0 * far_off / count : 1;
  const bool is_good = count >= least && mean <= 1 && share <= 0.005;
  return (is_good ? testing::AssertionSuccess() : testing::AssertionFailure())
         << count << " pixels, mean " << mean << " levels, over 4 levels " << 100 * share << " %";
}

/// Expects that the composite and the first projector's image agree with the judge's; `least`: as in agree().
inline void expect_agreement(Renderer* drawing, const JudgedRoom& room, int least_seen, int least_lit) {
  const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
  const auto seen =
      agree(composite_over_black(drawing, room), judge.parts_image(room.rig.cameras[0]), 0, least_seen);
  EXPECT_TRUE(seen) << seen.message();
  const auto lit =
      agree(drawing->projector_image(0, room.posed, room.viewer), judge.projector_image(0), 2.2, least_lit);
  EXPECT_TRUE(lit) << lit.message();
}

}  // namespace limn::projector
