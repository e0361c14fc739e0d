#pragma once

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "core/imager.h"
#include "scene/posed_scene.h"

namespace limn::apps {

/// Lines on the prototype's surface where its own coordinates are multiples of 10 mm, stronger ones at every
/// 50: of the two coordinates that run along the surface. Added to an 8-bit BGR display image, brighter of
/// the two. `points`: the prototype's point (m) that each of its pixels lights, CV_32FC3, NaN where none;
/// `share`: of the light there that is this projector's, CV_32FC2 (projector::Renderer::blend).
void draw_grid(const cv::Mat& points, const cv::Mat& share, cv::Mat* image);

/// Pixels that light points with x below `x_m` from `left`, others from `right`, with a thin line between
/// them. Where nothing is lit the brighter one stays.
cv::Mat split_at(const cv::Mat& points, double x_m, const cv::Mat& left, const cv::Mat& right);

/// Pixels on the side of a straight line where a x + b y + c < 0 from `left`, others from `right`, with a
/// thin line between them. 8-bit BGR, of one size.
cv::Mat split_along(const cv::Vec3d& abc, const cv::Mat& left, const cv::Mat& right);

/// Where an imager's image is split: the line on the prototype `split_mm` beside the middle of its box (its
/// own frame), as if that were flat there; a x + b y + c is negative where the prototype's x is smaller.
/// nullopt where it is not seen.
std::optional<cv::Vec3d> split_line(const Imager& imager,
                                    const scene::PosedScene& posed,
                                    const Eigen::AlignedBox3d& prototype_box,
                                    double split_mm);

}  // namespace limn::apps
