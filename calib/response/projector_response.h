#pragma once

#include <optional>
#include <span>
#include <string>

#include "calib/response/camera_response.h"
#include "calib/response/response_shots.h"
#include "core/photometric_response.h"

namespace limn::calib {

/// Samples of one camera, with what its levels mean.
struct DecodedSamples {
  const ResponseSamples* samples = nullptr;
  Decoding decoding;
};

/// A projector's curves, per channel, from its ramps: every pixel sees the same curve, each by a factor of
/// its own. A level's light over full light is a ratio of sums over pixels, each weighted by what the ramp's
/// OTHER images say of its brightness: noise then meets only noise of other images, and averages out (an
/// instrumental variable; plain least squares would bend the curve of a weak channel). Between the levels the
/// curve is a monotone cubic of light^(1/2.2). Black's light is left out here (the curves begin at 0).
/// Errors: a curve that jumps or falls (an image repeated, lost or out of order; automatic exposure), with
/// the image's name.
Result<ProjectorResponse> fitted_curves(const std::string& projector,
                               const std::string& where,
                               std::span<const DecodedSamples> samples);

/// Sums over small tiles of a camera's image that the panel's edge crosses: what black says of its light.
/// Black's light ends where white's does, and the room's light does not: in each tile the black image is
/// fitted as a plane plus a share of white minus black.
std::optional<Measurement> fitted_black_level(std::span<const ResponseShots* const> shots,
                                           std::span<const Decoding> decodings);

/// The curves with black's light at their beginning.
ProjectorResponse with_black_level(ProjectorResponse response, const std::optional<Measurement>& black_level);

/// Light (black's apart) of a display value in channel 0 blue, 1 green, 2 red; 0 … 1.
double light_over_black(const ProjectorResponse& response, int channel, int value);

}  // namespace limn::calib
