#pragma once

#include <array>
#include <span>

#include "calib/response/response_shots.h"
#include "core/photometric_response.h"

namespace limn::calib {

/// Estimates how a camera encodes light as levels. Light adds: a pixel receives `dark + sum of the shares
/// that are on`, whatever the projector's response, blur and albedo make of each share. So ten images of
/// white on eight sets of four shares (and none, and all) have five unknowns for each pixel. The encoding is
/// the curve whose light agrees with that within the levels' noise. Candidates, of which the first is chosen
/// that fits as well as the best: linear, sRGB (with a pedestal), a power (with a pedestal), a free curve of
/// twelve pieces. `unknown`, and linear, when the images cannot decide: shares that do not add, or whose sums
/// are too alike.
CameraResponse fitted_encoding(std::span<const ResponseSamples* const> samples);

/// Tables that convert levels to light, with weights for fits in light.
struct Decoding {
  std::array<float, 256> light;   ///< light of each level
  std::array<float, 256> weight;  ///< 1 / variance of that light for a variance of one level; 0 when clipped
};
Decoding decoding(const CameraResponse& response);

/// Standard deviation of one pixel between equal images, levels: for the black ones, for the white ones.
std::array<double, 2> noise_levels(std::span<const ResponseSamples* const> samples);

}  // namespace limn::calib
