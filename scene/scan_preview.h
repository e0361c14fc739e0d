#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/imager.h"
#include "scene/scan_surface.h"

namespace limn::scene {

/// An image of a surface for people to look at (8-bit BGR): lit from the viewer's side by its normals, in
/// its colours (clay without any), the nearest triangle in front; without triangles a small square for each
/// point. Triangles seen from behind are drawn darker. The viewer is an imager without distortion.
cv::Mat draw_scan_preview(const ScanSurface& surface, const Imager& viewer);

/// A viewer of the given size that has the whole surface in its image, looking from where `d_from` points
/// to (a direction in the surface's frame, from its middle), with `d_up` up.
Imager preview_viewer(const ScanSurface& surface,
                      const Eigen::Vector3d& d_from,
                      const Eigen::Vector3d& d_up,
                      int width,
                      int height);

/// Blue below -1, over grey at 0, to red above 1: the colour of a signed quantity as a share of its limit.
std::array<std::uint8_t, 3> signed_colour_rgb(double share);

/// Draws a scale below an image: the colours of signed_colour_rgb from low to high (high its limit) with a
/// caption in ASCII.
cv::Mat with_scale(const cv::Mat& image, double low_mm, double high_mm, const std::string& caption);

}  // namespace limn::scene
