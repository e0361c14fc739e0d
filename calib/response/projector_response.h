#pragma once

#include <optional>
#include <span>
#include <string>

#include "calib/response/camera_response.h"
#include "calib/response/response_shots.h"
#include "core/photometric_response.h"

namespace limn::calib {

/// Samples of one camera and the light of its levels.
struct DecodedSamples {
  const ResponseSamples* samples = nullptr;
  Decoding decoding;
};

/// Fits a projector's curves, for each channel, from its ramps: every pixel sees the same curve, scaled by a
/// factor of its own. The light of a value relative to full light is a ratio of sums over pixels, each
/// weighted by its brightness as estimated from the ramp's OTHER images: the noise of an image is then only
/// multiplied with noise of other images, and averages out (an instrumental variable; plain least squares
/// would bend the curve of a weak channel). Between the values the curve is a monotone cubic of
/// light^(1/2.2). The black level is not included (the curves begin at 0). Errors: a curve that jumps or
/// falls (an image repeated, lost or out of order; automatic exposure), with the image's name.
Result<ProjectorResponse> fitted_curves(const std::string& projector,
                                        const std::string& where,
                                        std::span<const DecodedSamples> samples);

/// Fits the black level (light of black as a share of white's) from small tiles of a camera's image that the
/// panel's edge crosses. Black's light ends where white's does, and the room's light does not: in each tile
/// the black image is fitted as a plane plus a share of white minus black.
std::optional<Measurement> fitted_black_level(std::span<const ResponseShots* const> shots,
                                              std::span<const Decoding> decodings);

/// The curves with the black level added: they begin at it.
ProjectorResponse with_black_level(ProjectorResponse response, const std::optional<Measurement>& black_level);

/// Light (without the black level) of a display value in channel 0 blue, 1 green, 2 red; 0 … 1.
double light_over_black(const ProjectorResponse& response, int channel, int value);

}  // namespace limn::calib
