#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/photometric_response.h"

namespace limn::calib {

/// Light of one place of white paper in one camera, less what geometry takes: (white - black) / (cosine of
/// incidence / distance^2). What is left is one factor for the camera and projector, times the vignetting of
/// both.
struct PaperLight {
  int camera = 0;
  int projector = 0;
  Eigen::Vector2d px_camera = Eigen::Vector2d::Zero();
  Eigen::Vector2d px_projector = Eigen::Vector2d::Zero();
  double light = 0;
};

/// The board's paper at the matches of a solve, from the white and black images of its poses. Cameras
/// without a response are left out, and so is light that is cut off.
Result<std::vector<PaperLight>> paper_light(const CaptureSet& captures,
                                            const Observations& observations,
                                            const Solution& solution,
                                            const std::vector<CameraResponse>& cameras);

/// Vignetting of cameras and projectors, apart from each other: the board stands where it likes, so a
/// projector's pixel is seen by different pixels of the camera. One robust fit of the logarithms. A
/// projector's may be tilted (a shifted lens); a camera's only depends on the radius. Weak priors (a gain in
/// a corner of 1, standard deviation 0.5) hold what the poses leave open; corner_stddev then tells. Nothing
/// from fewer than 50 places.
void add_vignetting(std::span<const PaperLight> light,
                    const std::vector<CapturedDevice>& cameras,
                    const std::vector<CapturedDevice>& projectors,
                    RigResponses* responses);

}  // namespace limn::calib
