#pragma once

#include "calib/response/projector_response.h"

namespace limn::calib {

/// Fits what each pixel of a camera receives from each channel of a projector, by weighted least squares over
/// the ramps and the black images; clipped levels are not used. The result includes how well photographs of
/// the check colours, which the fit does not use, are predicted.
ColourMixing fitted_mixing(const ResponseShots& shots,
                           const ProjectorResponse& projector,
                           const CameraResponse& camera);

/// The photograph, in levels (CV_32F or CV_32FC3), that a mixing predicts while the projector shows one
/// colour (display values, BGR) everywhere.
cv::Mat predicted_photograph(const ColourMixing& mixing,
                             const ProjectorResponse& projector,
                             const CameraResponse& camera,
                             const cv::Vec3b& bgr);

}  // namespace limn::calib
