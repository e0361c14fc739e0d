#pragma once

#include <vector>

#include "calib/capture_set.h"
#include "core/photometric_response.h"
#include "core/result.h"

namespace limn::calib {

/// What response images tell.
struct MeasuredResponse {
  RigResponses responses;
  std::vector<ColourMixing> mixings;  ///< of every projector in every camera that sees it
  std::vector<std::string> warnings;  ///< sentences: what could not be told, what is unusual
};

/// Encodings of the cameras, curves of the projectors and the mixing of every pixel, from the captures'
/// response/ folder; nothing when there is none. A camera that sees nothing of a projector which another
/// camera sees is left out. Errors name the image.
Result<MeasuredResponse> measure_response(const CaptureSet& captures);

}  // namespace limn::calib
