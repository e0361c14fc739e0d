#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::calib {

/// What a projector shows in one response image: a colour, everywhere or on a part of its pixels.
struct ResponseImage {
  enum class Role {
    black,  ///< several times, for drift and noise
    white,  ///< the same
    share,  ///< white on some of four equal shares of the pixels, which add up in light whatever the response
    border,  ///< white along the panel's edge: shows where the panel ends
    ramp,    ///< one channel at one value
    grey,    ///< all channels at one value: checks whether the channels add
    check    ///< a colour that is only used to check the prediction of the fit
  };
  Role role = Role::black;
  cv::Vec3b bgr = {0, 0, 0};
  unsigned shares = 15;  ///< bit i: the pixels with (x mod 2) + 2 (y mod 2) = i are on
  std::string what() const;
};

/// Number of values of each channel's ramp; with 0 that gives steps of 21.25, between which a smooth response
/// is almost straight.
constexpr int k_ramp_levels = 12;
/// Width of the border as a share of the panel's smaller side.
constexpr double k_border = 0.04;

/// The images that measure a projector's response, in the order in which they are shown; at most 60.
const std::vector<ResponseImage>& response_images();

/// Image number `index` for a projector's size, 8-bit BGR.
cv::Mat draw_response(int index, int width, int height);

/// Writes a JSON list of what is shown (limn.response_patterns/1), for people and other programs.
Status save_response_patterns(int width, int height, const std::filesystem::path& path);

}  // namespace limn::calib
