#pragma once

#include <array>
#include <opencv2/core/mat.hpp>

#include "core/enum_names.h"
#include "core/imager.h"

namespace limn {

/// How a display takes the images for a person's two eyes.
enum class StereoLayout {
  off,               ///< One image, for both eyes.
  side_by_side,      ///< Both in one image, each half as wide; the left eye's on the left.
  top_bottom,        ///< Both in one image, each half as high; the left eye's at the top.
  frame_sequential,  ///< In turns, the left eye's first: each image of the session is two of the display.
  quad_buffer        ///< In OpenGL's left and right buffers; the driver shows them in turns.
};
inline constexpr EnumNames<StereoLayout, 5> k_stereo_layouts{
    {"off", "side_by_side", "top_bottom", "frame_sequential", "quad_buffer"}};

/// The images for two eyes, of one size and type.
struct EyeImages {
  cv::Mat left;
  cv::Mat right = {};  ///< Empty: both eyes get the left one.

  bool is_stereo() const { return !right.empty(); }
};

/// Both images in one of `size`, for the layouts side_by_side and top_bottom: each is scaled to its half,
/// pixels are averaged.
cv::Mat packed(const EyeImages& images, StereoLayout layout, cv::Size size);

/// Both images side by side, each with all of its pixels.
cv::Mat both(const EyeImages& images);

/// What a person sees where one image must serve both eyes, or where a camera exposes both: the mean of their
/// light, in display values of gamma 2.2. 8-bit images.
cv::Mat mean_light(const EyeImages& images);

/// Imagers at a viewer's left and right eye, `apart_m` apart along the viewer's x axis.
std::array<Imager, 2> eyes(const Imager& viewer, double apart_m);

}  // namespace limn
