#include "scene/lines/outline.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace limn::scene {
namespace {

constexpr double k_pixels_of_side = 2000;
constexpr double k_simplified_px = 0.7;  // distance of the outline's corners from the image's
constexpr double k_least_area_px = 16;   // smaller pieces and holes are rounding
constexpr double k_depth = 0.1;          // m; how far the surface may be below the part's plane
constexpr double k_above = 5e-3;         // m; a part may be sunk into the surface by so much
constexpr double k_step = 2e-3;          // m between the points that are laid
constexpr int k_border_px = 4;

}  // namespace

Outline outline_of(const Mesh& mesh) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p.head<2>().cast<double>());
  if (box.isEmpty() || !(box.sizes().maxCoeff() > 1e-6)) return {};
  const double scale = k_pixels_of_side / box.sizes().maxCoeff();
  const cv::Size size(2 * k_border_px + cvCeil(scale * box.sizes().x()),
                      2 * k_border_px + cvCeil(scale * box.sizes().y()));
  cv::Mat mask = cv::Mat::zeros(size, CV_8U);
  constexpr int k_shift = 4;  // bits below a pixel
  for (const auto& triangle : mesh.triangles) {
    cv::Point corners[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d px = scale * (mesh.positions[triangle[k]].head<2>().cast<double>() - box.min());
      corners[k] = {cvRound((px.x() + k_border_px) * (1 << k_shift)),
                    cvRound((px.y() + k_border_px) * (1 << k_shift))};
    }
    cv::fillConvexPoly(mask, corners, 3, 255, cv::LINE_8, k_shift);
  }
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  Outline out;
  for (const Eigen::Vector3f& p : mesh.positions)
    if (std::abs(p.z()) > std::abs(out.z_top)) out.z_top = p.z();
  for (const auto& contour : contours) {
    if (cv::contourArea(contour) < k_least_area_px) continue;
    std::vector<cv::Point> simple;
    cv::approxPolyDP(contour, simple, k_simplified_px, true);
    if (simple.size() < 3) continue;
    out.rings.emplace_back();
    for (const cv::Point& px : simple)
      out.rings.back().emplace_back(Eigen::Vector2d(px.x - k_border_px, px.y - k_border_px) / scale +
                                    box.min());
  }
  return out;
}

std::vector<SurfaceCurve> laid_outline(const Drape& prototype,
                                       const Outline& outline,
                                       const Pose& prototype_from_part) {
  const double side = outline.z_top < 0 ? -1 : 1, height = std::abs(outline.z_top) + k_above;
  const Eigen::Vector3d d_down = prototype_from_part.rotation * Eigen::Vector3d(0, 0, -side);
  const auto on_surface = [&](const Eigen::Vector2d& at) {
    return prototype.hit(prototype_from_part * Eigen::Vector3d(at.x(), at.y(), side * height), d_down,
                         height + k_depth);
  };
  std::vector<SurfaceCurve> out;
  for (const auto& ring : outline.rings) {
    std::vector<std::optional<SurfacePoint>> hits;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Eigen::Vector2d &a = ring[i], &b = ring[(i + 1) % ring.size()];
      const int steps = std::max(1, cvCeil((b - a).norm() / k_step));
      for (int k = 0; k < steps; ++k) hits.push_back(on_surface(a + (b - a) * k / steps));
    }
    const bool is_whole =
        std::all_of(hits.begin(), hits.end(), [](const auto& hit) { return hit.has_value(); });
    exchange::NamedCurve piece{"", {}, is_whole};
    const auto finish_piece = [&] {
      if (piece.points.size() >= 2)
        if (auto laid = prototype.laid(piece, "outline")) out.push_back(std::move(*laid));
      piece.points.clear();
    };
    for (const auto& hit : hits) {
      if (hit)
        piece.points.push_back(hit->p);
      else
        finish_piece();
    }
    finish_piece();
  }
  return out;
}

std::vector<SurfaceCurve> Outlines::of(const std::string& name,
                                       const Mesh& mesh,
                                       const Pose& prototype_from_part) const {
  constexpr double k_jitter_m = 0.1e-3, k_jitter_rad = 1e-3;
  const std::lock_guard lock(mutex_);
  Laid& laid = laid_[name];
  if (laid.prototype_from_part) {
    const Pose moved = laid.prototype_from_part->inverse() * prototype_from_part;
    if (moved.translation.norm() < k_jitter_m && Eigen::AngleAxisd(moved.rotation).angle() < k_jitter_rad)
      return laid.curves;
  } else {
    laid.outline = outline_of(mesh);
  }
  laid.prototype_from_part = prototype_from_part;
  laid.curves = laid_outline(*prototype_, laid.outline, prototype_from_part);
  return laid.curves;
}

}  // namespace limn::scene
