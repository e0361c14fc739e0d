#include "scene/meshes/scan_preview.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace limn::scene {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::array<std::uint8_t, 3> k_clay_rgb = {205, 200, 190};
constexpr double k_fov_deg = 30;   // weak perspective, like a long lens
constexpr double k_margin = 1.12;  // radius in view, as a multiple of the surface's radius
constexpr double k_behind = 0.35;  // brightness of triangles seen from behind
const cv::Scalar k_background_bgr(46, 42, 40);

struct Projected {
  Vector2d px = Vector2d::Zero();
  double inverse_depth = 0;
  Vector3d colour_bgr = Vector3d::Zero();  // after shading
  bool seen = false;
};

Vector3d lit_colour(const ScanSurface& surface,
                    std::size_t i,
                    const Vector3d& d_to_eye,
                    const Vector3d& d_light) {
  const auto& rgb = surface.colours_rgb.empty() ? k_clay_rgb : surface.colours_rgb[i];
  const Vector3d colour(rgb[2], rgb[1], rgb[0]);
  if (surface.normals.empty()) return colour;
  const Vector3d normal = surface.normals[i].cast<double>();
  const bool behind = normal.dot(d_to_eye) < 0;
  const double light = std::max(0.0, normal.dot(d_light) * (behind ? -1 : 1));
  return colour * (0.25 + 0.75 * light) * (behind ? k_behind : 1);
}

std::vector<Projected> corners_of(const ScanSurface& surface, const Imager& viewer) {
  const Pose world_from_viewer = viewer.imager_from_world.inverse();
  const Vector3d d_light = (world_from_viewer.rotation * Vector3d(-0.45, -0.6, -1))
                               .normalized();  // the light comes over the viewer's left shoulder
  std::vector<Projected> corners(surface.positions.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d p = surface.positions[i].cast<double>();
    const double depth = (viewer.imager_from_world * p).z();
    const auto px = viewer.project(p);
    if (!px || depth <= 0) continue;
    corners[i] = {*px, 1 / depth,
                  lit_colour(surface, i, (world_from_viewer.translation - p).normalized(), d_light), true};
  }
  return corners;
}

struct Canvas {
  cv::Mat image, nearest;  // `nearest` holds inverse depths
  explicit Canvas(const Imager& viewer)
      : image(viewer.height, viewer.width, CV_8UC3, k_background_bgr),
        nearest(viewer.height, viewer.width, CV_64F, cv::Scalar(0)) {}

  void put(int x, int y, double inverse_depth, const Vector3d& bgr) {
    if (inverse_depth <= nearest.at<double>(y, x)) return;
    nearest.at<double>(y, x) = inverse_depth;
    for (int c = 0; c < 3; ++c) image.at<cv::Vec3b>(y, x)[c] = cv::saturate_cast<uchar>(bgr[c]);
  }
};

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

void fill(const Projected& a, const Projected& b, const Projected& c, Canvas* canvas) {
  if (!a.seen || !b.seen || !c.seen) return;
  const double area = cross(b.px - a.px, c.px - a.px);
  if (std::abs(area) < 1e-12) return;
  const Vector2d low = a.px.cwiseMin(b.px).cwiseMin(c.px), high = a.px.cwiseMax(b.px).cwiseMax(c.px);
  const int x0 = std::max(0, static_cast<int>(std::ceil(low.x()))),
            y0 = std::max(0, static_cast<int>(std::ceil(low.y())));
  const int x1 = static_cast<int>(std::floor(std::min<double>(high.x(), canvas->image.cols - 1)));
  const int y1 = static_cast<int>(std::floor(std::min<double>(high.y(), canvas->image.rows - 1)));
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const Vector2d p(x, y);
      const double u = cross(p - a.px, c.px - a.px) / area, v = cross(b.px - a.px, p - a.px) / area;
      if (u < 0 || v < 0 || u + v > 1) continue;
      const double w = 1 - u - v;
      canvas->put(x, y, w * a.inverse_depth + u * b.inverse_depth + v * c.inverse_depth,
                  w * a.colour_bgr + u * b.colour_bgr + v * c.colour_bgr);
    }
}

}  // namespace

cv::Mat draw_scan_preview(const ScanSurface& surface, const Imager& viewer) {
  const std::vector<Projected> corners = corners_of(surface, viewer);
  Canvas canvas(viewer);
  for (const auto& [i, j, k] : surface.triangles) fill(corners[i], corners[j], corners[k], &canvas);
  if (!surface.triangles.empty()) return canvas.image;
  for (const Projected& corner : corners) {
    if (!corner.seen || !viewer.contains(corner.px)) continue;
    const cv::Rect square = cv::Rect(static_cast<int>(corner.px.x()), static_cast<int>(corner.px.y()), 2, 2) &
                            cv::Rect({}, canvas.image.size());
    for (int y = square.y; y < square.br().y; ++y)
      for (int x = square.x; x < square.br().x; ++x)
        canvas.put(x, y, corner.inverse_depth, corner.colour_bgr);
  }
  return canvas.image;
}

Imager preview_viewer(
    const ScanSurface& surface, const Vector3d& d_from, const Vector3d& d_up, int width, int height) {
  Eigen::AlignedBox3d box;
  for (const auto& p : surface.positions) box.extend(p.cast<double>());
  const double radius = k_margin * std::max(1e-6, box.diagonal().norm() / 2);
  const double least_fov =
      k_fov_deg * std::min(1.0, static_cast<double>(height) / width) * std::numbers::pi / 180;
  const double distance = radius / std::sin(least_fov / 2);
  const Vector3d d = d_from.normalized();
  const Vector3d up = std::abs(d.dot(d_up.normalized())) > 0.99 ? d_up + 0.1 * d.unitOrthogonal() : d_up;
  const Pose viewer_from_world = looking_at(box.center() + distance * d, box.center(), up);
  return viewer_imager(viewer_from_world.inverse(), width, height, k_fov_deg);
}

std::array<std::uint8_t, 3> signed_colour_rgb(double share) {
  const double s = std::clamp(share, -1.0, 1.0),
               size = std::sqrt(std::abs(s));  // the square root makes small values visible
  const Vector3d grey(225, 225, 225), end = s > 0 ? Vector3d(200, 30, 30) : Vector3d(25, 70, 205);
  const Vector3d rgb = grey + size * (end - grey);
  return {static_cast<std::uint8_t>(rgb[0]), static_cast<std::uint8_t>(rgb[1]),
          static_cast<std::uint8_t>(rgb[2])};
}

cv::Mat with_scale(const cv::Mat& image, double low_mm, double high_mm, const std::string& caption) {
  constexpr int k_strip = 56;
  cv::Mat out(image.rows + k_strip, image.cols, CV_8UC3, cv::Scalar::all(255));
  image.copyTo(out.rowRange(0, image.rows));
  const int left = 16, width = std::min(420, image.cols / 2), top = image.rows + 8;
  for (int x = 0; x < width; ++x) {
    const auto rgb = signed_colour_rgb((low_mm + (high_mm - low_mm) * x / (width - 1)) / high_mm);
    cv::line(out, {left + x, top}, {left + x, top + 16}, cv::Scalar(rgb[2], rgb[1], rgb[0]));
  }
  const auto text = [&](const std::string& words, int x, int y) {
    cv::putText(out, words, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.45, cv::Scalar::all(30), 1, cv::LINE_AA);
  };
  text(fmt::format("{:g} mm", low_mm), left, top + 36);
  text(fmt::format("{:g} mm", high_mm), left + width - 50, top + 36);
  text(caption, left + width + 30, top + 14);
  return out;
}

}  // namespace limn::scene
