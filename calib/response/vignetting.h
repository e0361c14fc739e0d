#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/photometric_response.h"

namespace limn::calib {

/// Light of a point of the board's white paper in one camera, with the geometry divided out:
/// (white - black) / (cosine of incidence / distance^2). The remaining value is one factor for the camera and
/// projector, times the vignetting of both.
struct PaperLight {
  int camera = 0;
  int projector = 0;
  Eigen::Vector2d px_camera = Eigen::Vector2d::Zero();
  Eigen::Vector2d px_projector = Eigen::Vector2d::Zero();
  double light = 0;
};

/// Measures the board's paper at the matches of a solve, from the white and black images of its poses.
/// Cameras without a response and clipped levels are skipped.
Result<std::vector<PaperLight>> paper_light(const CaptureSet& captures,
                                            const Observations& observations,
                                            const Solution& solution,
                                            const std::vector<CameraResponse>& cameras);

/// Estimates the vignetting of cameras and projectors. The two can be separated because the board stands in
/// many places, so that different pixels of the camera see the same pixel of the projector. One robust fit of
/// the logarithms. A projector's vignetting may be tilted (a shifted lens); a camera's depends on the radius
/// only. Weak priors (a gain in a corner of 1, standard deviation 0.5) hold what the poses leave
/// undetermined; corner_stddev is then large. With fewer than 50 points nothing is estimated.
void add_vignetting(std::span<const PaperLight> light,
                    const std::vector<CapturedDevice>& cameras,
                    const std::vector<CapturedDevice>& projectors,
                    RigResponses* responses);

}  // namespace limn::calib
