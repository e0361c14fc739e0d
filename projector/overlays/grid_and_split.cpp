#include "projector/overlays/grid_and_split.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/photometric_response.h"

namespace limn::projector {
namespace {

using Eigen::Vector3f;

constexpr float k_grid_m = 0.010F;
constexpr int k_strong_every = 5;
constexpr float k_weak = 90, k_strong = 180, k_split = 160;  // display values
// Accurate enough for lines that two projectors share.
constexpr auto k_gamma = static_cast<float>(k_display_gamma);
constexpr float k_line_px = 1, k_strong_px = 1.6F;  // half the width of a line with its soft edges

// Steps of the surface point from one pixel to the next, to the right and down; zero at edges.
struct Steps {
  Vector3f right = Vector3f::Zero(), down = Vector3f::Zero();
};

const Vector3f& at(const cv::Mat& points, int x, int y) {
  return *reinterpret_cast<const Vector3f*>(points.ptr<float>(y) + 3 * x);
}

Steps steps_at(const cv::Mat& points, int x, int y) {
  Steps steps;
  const auto step = [&](int dx, int dy) -> Vector3f {
    for (const int sign : {1, -1}) {
      const int to_x = x + sign * dx, to_y = y + sign * dy;
      if (to_x < 0 || to_y < 0 || to_x >= points.cols || to_y >= points.rows) continue;
      const Vector3f step = static_cast<float>(sign) * (at(points, to_x, to_y) - at(points, x, y));
      if (step.allFinite()) return step;
    }
    return Vector3f::Zero();
  };
  steps.right = step(1, 0);
  steps.down = step(0, 1);
  return steps;
}

// Display value of the grid lines at a point.
float line_value(const Vector3f& p, const Steps& steps) {
  const Vector3f normal = steps.right.cross(steps.down).cwiseAbs();
  int across = 0;  // the coordinate along the normal; its lines would be contours of the surface
  normal.maxCoeff(&across);
  float value = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float per_px = std::hypot(steps.right[axis], steps.down[axis]);
    if (axis == across || per_px <= 0) continue;
    const float line = std::round(p[axis] / k_grid_m);
    const bool is_strong = static_cast<int>(line) % k_strong_every == 0;
    const float away_px = std::abs(p[axis] - line * k_grid_m) / per_px;
    const float cover = std::clamp((is_strong ? k_strong_px : k_line_px) - away_px, 0.0F, 1.0F);
    value = std::max(value, cover * (is_strong ? k_strong : k_weak));
  }
  return value;
}

}  // namespace

void draw_grid(const cv::Mat& points, const cv::Mat& share, cv::Mat* image) {
  for (int y = 0; y < image->rows; ++y) {
    std::uint8_t* bgr = image->ptr<std::uint8_t>(y);
    const float* shares = share.ptr<float>(y);
    for (int x = 0; x < image->cols; ++x, bgr += 3) {
      const Vector3f& p = at(points, x, y);
      if (!p.allFinite() || !(shares[2 * x] > 0)) continue;
      const float value = line_value(p, steps_at(points, x, y));
      if (value <= 0) continue;
      const auto light = cv::saturate_cast<std::uint8_t>(value * std::pow(shares[2 * x], 1 / k_gamma));
      for (int i = 0; i < 3; ++i) bgr[i] = std::max(bgr[i], light);
    }
  }
}

cv::Mat split_at(const cv::Mat& points, double x_m, const cv::Mat& left, const cv::Mat& right) {
  cv::Mat out(right.size(), right.type());
  for (int y = 0; y < out.rows; ++y) {
    const std::uint8_t *a = left.ptr<std::uint8_t>(y), *b = right.ptr<std::uint8_t>(y);
    std::uint8_t* bgr = out.ptr<std::uint8_t>(y);
    for (int x = 0; x < out.cols; ++x, a += 3, b += 3, bgr += 3) {
      const Vector3f& p = at(points, x, y);
      const bool is_lit = p.allFinite();
      const float away = is_lit ? p.x() - static_cast<float>(x_m) : 0;
      const Steps steps = is_lit ? steps_at(points, x, y) : Steps{};
      const float per_px = std::hypot(steps.right.x(), steps.down.x());
      const bool is_line = is_lit && std::abs(away) < 0.5F * k_line_px * per_px;
      for (int i = 0; i < 3; ++i) {
        bgr[i] = !is_lit ? std::max(a[i], b[i]) : away < 0 ? a[i] : b[i];
        if (is_line) bgr[i] = std::max(bgr[i], static_cast<std::uint8_t>(k_split));
      }
    }
  }
  return out;
}

cv::Mat split_along(const cv::Vec3d& abc, const cv::Mat& left, const cv::Mat& right) {
  cv::Mat out = right.clone();
  const double per_px = std::hypot(abc[0], abc[1]);
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) {
      const double away_px = (abc[0] * x + abc[1] * y + abc[2]) / per_px;
      auto& bgr = out.at<cv::Vec3b>(y, x);
      if (away_px < 0) bgr = left.at<cv::Vec3b>(y, x);
      if (std::abs(away_px) >= 0.5 * static_cast<double>(k_line_px)) continue;
      for (int i = 0; i < 3; ++i) bgr[i] = std::max(bgr[i], static_cast<std::uint8_t>(k_split));
    }
  }
  return out;
}

std::optional<cv::Vec3d> split_line(const Imager& imager,
                                    const scene::PosedScene& posed,
                                    const Eigen::AlignedBox3d& prototype_box,
                                    double split_mm) {
  if (!posed.world_from_prototype || prototype_box.isEmpty()) return std::nullopt;
  Eigen::Vector3d p_middle = prototype_box.center(), d_along = prototype_box.sizes() / 4;
  p_middle.x() += 1e-3 * split_mm;
  (d_along.y() > d_along.z() ? d_along.z() : d_along.y()) = 0;
  d_along.x() = 0;
  const Eigen::Vector3d beside = p_middle - Eigen::Vector3d(0.01, 0, 0);
  std::vector<Eigen::Vector2d> px;
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(p_middle - d_along), Eigen::Vector3d(p_middle + d_along), beside}) {
    const auto seen = imager.project(*posed.world_from_prototype * p);
    if (!seen) return std::nullopt;
    px.push_back(*seen);
  }
  const Eigen::Vector2d along = px[1] - px[0];
  if (along.norm() < 1) return std::nullopt;
  cv::Vec3d abc(-along.y(), along.x(), along.y() * px[0].x() - along.x() * px[0].y());
  return abc[0] * px[2].x() + abc[1] * px[2].y() + abc[2] < 0 ? abc : -abc;
}

}  // namespace limn::projector
