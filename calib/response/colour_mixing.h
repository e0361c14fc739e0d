#pragma once

#include "calib/response/projector_response.h"

namespace limn::calib {

/// What each pixel of a camera sees of each channel of a projector, by weighted least squares over the ramps
/// and the black pictures; levels that are cut off are left out. Also says how well photographs of the check
/// colours, which are not used, are foretold.
ColourMixing fitted_mixing(const ResponseShots& shots,
                           const Response& projector,
                           const CameraResponse& camera);

/// The photograph, in levels (CV_32F or CV_32FC3), that a mixing foretells while the projector shows one
/// colour (display values, BGR) everywhere.
cv::Mat foretold_photograph(const ColourMixing& mixing,
                            const Response& projector,
                            const CameraResponse& camera,
                            const cv::Vec3b& bgr);

}  // namespace limn::calib
