#pragma once

#include <vector>

#include "calib/capture_set.h"
#include "core/photometric_response.h"
#include "core/result.h"

namespace limn::calib {

/// The results of the response images.
struct MeasuredResponse {
  RigResponses responses;
  std::vector<ColourMixing> mixings;  ///< for every projector in every camera that sees it
  std::vector<std::string> warnings;  ///< sentences: what could not be measured, what is unusual
};

/// Measures encodings of the cameras, curves of the projectors and the mixing of every pixel, from the
/// captures' response/ folder; empty when there is none. A camera that sees nothing of a projector which
/// another camera sees is skipped. Errors name the image.
Result<MeasuredResponse> measure_response(const CaptureSet& captures);

}  // namespace limn::calib
