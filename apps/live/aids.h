#pragma once

#include <opencv2/core/mat.hpp>

namespace limn::apps {

/// Lines on the prototype's surface where its own coordinates are multiples of 10 mm, stronger ones at every
/// 50: of the two coordinates that run along the surface. Added to an 8-bit BGR display picture, brighter of
/// the two. `points`: the prototype's point (m) that each of its pixels lights, CV_32FC3, NaN where none;
/// `share`: of the light there that is this projector's, CV_32FC2 (projector::Renderer::blend).
void draw_grid(const cv::Mat& points, const cv::Mat& share, cv::Mat* picture);

/// Pixels that light points with x below `x_m` from `left`, others from `right`, with a thin line between
/// them. Where nothing is lit the brighter one stays.
cv::Mat split_at(const cv::Mat& points, double x_m, const cv::Mat& left, const cv::Mat& right);

/// Pixels on the side of a straight line where a x + b y + c < 0 from `left`, others from `right`, with a
/// thin line between them. 8-bit BGR, of one size.
cv::Mat split_along(const cv::Vec3d& abc, const cv::Mat& left, const cv::Mat& right);

}  // namespace limn::apps
