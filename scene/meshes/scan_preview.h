#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/imager.h"
#include "scene/meshes/scan_surface.h"

namespace limn::scene {

/// An image of a surface for people (8-bit BGR). It is shaded by its normals with light from the viewer's
/// side, in its own colours (or the colour of clay). The nearest triangle hides others; without triangles
/// each point is a small square. Triangles seen from behind are darker. The viewer must have no distortion.
cv::Mat draw_scan_preview(const ScanSurface& surface, const Imager& viewer);

/// A viewer of the given size that sees the whole surface. It stands in direction `d_from` from the surface's
/// middle (in the surface's frame) and has `d_up` up.
Imager preview_viewer(const ScanSurface& surface,
                      const Eigen::Vector3d& d_from,
                      const Eigen::Vector3d& d_up,
                      int width,
                      int height);

/// The colour of a signed quantity, given as a share of its limit: from blue at -1 over grey at 0 to red at
/// 1; shares beyond are clamped.
std::array<std::uint8_t, 3> signed_colour_rgb(double share);

/// Adds a colour scale below an image: the colours of signed_colour_rgb() from `low_mm` to `high_mm`, where
/// `high_mm` is the limit, and a caption in ASCII.
cv::Mat with_scale(const cv::Mat& image, double low_mm, double high_mm, const std::string& caption);

}  // namespace limn::scene
