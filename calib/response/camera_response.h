#pragma once

#include <array>
#include <span>

#include "calib/response/response_shots.h"
#include "core/photometric_response.h"

namespace limn::calib {

/// Finds how a camera writes light as levels. Light adds: a pixel sees `dark + sum of the lit shares`,
/// whatever shares the projector's response, blur and albedo give it, so ten images of white on eight sets
/// of four shares (and none, and all) hold five unknowns a pixel. The encoding is the curve whose light
/// agrees with that within the levels' noise. Tried in turn, the first that fits as well as the best does:
/// linear, sRGB (with a pedestal), a power (with one), a free curve of twelve pieces. `unknown`, and linear,
/// when the images do not tell: shares that do not add, or whose sums are too alike.
CameraResponse fitted_encoding(std::span<const ResponseSamples* const> samples);

/// What turns levels into light and back, with weights for fits in light.
struct Decoding {
  std::array<float, 256> light;   ///< of levels
  std::array<float, 256> weight;  ///< 1 / variance of that light for a variance of one level; 0 when clipped
};
Decoding decoding(const CameraResponse& response);

/// Standard deviation of one pixel between equal images, levels: of the black ones, of the white ones.
std::array<double, 2> noise_levels(std::span<const ResponseSamples* const> samples);

}  // namespace limn::calib
