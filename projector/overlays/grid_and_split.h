#pragma once

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "core/imager.h"
#include "scene/posed_scene.h"

namespace limn::projector {

/// Draws grid lines on the prototype's surface at multiples of 10 mm of its own coordinates, stronger ones at
/// multiples of 50 mm, for the two coordinates that run along the surface. Draws into an 8-bit BGR display
/// image; each pixel keeps the brighter value. `points`: the point of the prototype (its frame, m) that each
/// pixel illuminates, CV_32FC3, NaN where none. `share`: this projector's share of the light there, CV_32FC2
/// (Renderer::blend).
void draw_grid(const cv::Mat& points, const cv::Mat& share, cv::Mat* image);

/// Joins two images: pixels that illuminate points with x below `x_m` come from `left`, others from `right`,
/// with a thin line between them. A pixel that illuminates no point gets the brighter value.
cv::Mat split_at(const cv::Mat& points, double x_m, const cv::Mat& left, const cv::Mat& right);

/// Joins two images along a straight line: pixels where a x + b y + c < 0 come from `left`, others from
/// `right`, with a thin line between them. 8-bit BGR, of the same size.
cv::Mat split_along(const cv::Vec3d& abc, const cv::Mat& left, const cv::Mat& right);

/// The line that splits an imager's image: it is the image of the line on the prototype that lies `split_mm`
/// in x beside the middle of its box (prototype frame), as if the prototype were flat there. a x + b y + c is
/// negative where the prototype's x is smaller. nullopt: the prototype has no pose, or the line is not in
/// view.
std::optional<cv::Vec3d> split_line(const Imager& imager,
                                    const scene::PosedScene& posed,
                                    const Eigen::AlignedBox3d& prototype_box,
                                    double split_mm);

}  // namespace limn::projector
