#include "remote/pairing_overlay.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "device/gui/qr_code.h"

namespace limn::remote {
namespace {

constexpr auto k_font = cv::FONT_HERSHEY_SIMPLEX;
constexpr double k_capital_px = 22;        // height of the font's capitals at scale 1
constexpr double k_fill = 0.8;             // share of the width that text fills
constexpr int k_candidates_per_side = 40;  // along the image's shorter side
constexpr int k_nodes = 8;                 // points that are checked along each side of a place
constexpr double k_flat = 0.03;            // largest distance from a plane, as a share of the sign's width
constexpr double k_smaller = 0.93;         // factor from one size that is tried to the next
constexpr double k_least_upright = 0.2;    // sine of the angle between the surface's normal and up

std::optional<Eigen::Vector3d> point_at(const cv::Mat& points, int x, int y) {
  const auto& p = points.at<cv::Vec3f>(y, x);
  if (!std::isfinite(p[0])) return std::nullopt;
  return Eigen::Vector3d(p[0], p[1], p[2]);
}

// Draws a line of centred text. Returns the top of the next row.
int draw_text(const std::string& text, double share, int top, cv::Mat* sign) {
  constexpr int k_measured = 1;
  const cv::Size unit = cv::getTextSize(text, k_font, 1, k_measured, nullptr);
  const double scale = share * sign->cols / unit.width;
  const int height = static_cast<int>(std::ceil(k_capital_px * scale));
  const int left = static_cast<int>(0.5 * (1 - share) * sign->cols);
  cv::putText(*sign, text, {left, top + height}, k_font, scale, cv::Scalar(),
              std::max(1, static_cast<int>(2.5 * scale)), cv::LINE_AA);
  return top + height + height / 2;
}

}  // namespace

cv::Mat pairing_code_image(const std::string& text,
                           const std::string& pin,
                           const std::string& role,
                           int module_px) {
  const cv::Mat code = gui::qr_code(text);
  if (code.empty()) return {};
  cv::Mat large;
  cv::resize(code, large, {}, module_px, module_px, cv::INTER_NEAREST);
  cv::Mat sign(large.rows * 3 / 2, large.cols, CV_8UC3, cv::Scalar::all(255));
  cv::cvtColor(large, sign(cv::Rect({}, large.size())), cv::COLOR_GRAY2BGR);
  const int next = draw_text(pin, k_fill, large.rows - module_px, &sign);
  const int end = draw_text("Limn: " + role, k_fill / 2, next, &sign);
  return sign.rowRange(0, std::min(sign.rows, end + 2 * module_px)).clone();
}

cv::Mat pin_image(const std::string& pin, const std::string& role, int width) {
  cv::Mat sign(width, width, CV_8UC3, cv::Scalar::all(255));
  const int margin = width / 12;
  const int next = draw_text(pin, k_fill, margin, &sign);
  return sign.rowRange(0, draw_text("Limn: " + role, k_fill / 2, next, &sign) + margin / 2).clone();
}

std::optional<projector::OverlayPlace> overlay_place(const Imager& projector,
                                                     const Pose& world_from_prototype,
                                                     const cv::Mat& points,
                                                     const Eigen::Vector3d& d_up,
                                                     cv::Size shape,
                                                     double least_px) {
  const double aspect = 1.0 * shape.height / shape.width;
  const int step = std::max(1, std::min(points.cols, points.rows) / k_candidates_per_side);
  struct Candidate {
    Eigen::Vector3d p;
    Eigen::Vector3d d_right, d_down;  // unit vectors
    double m_per_px;                  // in the direction of the strongest foreshortening
  };
  std::vector<Candidate> candidates;
  for (int y = step; y < points.rows - step; y += step)
    for (int x = step; x < points.cols - step; x += step) {
      const auto p = point_at(points, x, y);
      const auto right = point_at(points, x + step / 2, y), left = point_at(points, x - step / 2, y),
                 down = point_at(points, x, y + step / 2), up = point_at(points, x, y - step / 2);
      if (!p || !right || !left || !down || !up) continue;
      const Eigen::Vector3d n = (*right - *left).cross(*down - *up).normalized();  // into the surface
      const Eigen::Vector3d d_right = n.cross(d_up);
      if (d_right.norm() < k_least_upright) continue;
      candidates.push_back({*p, d_right.normalized(), n.cross(d_right).normalized(),
                            std::max((*right - *left).norm(), (*down - *up).norm()) / (2 * (step / 2))});
    }
  const auto place_at = [&](const Candidate& candidate, double width) {
    const Eigen::Vector3d d_right = width * candidate.d_right, d_down = aspect * width * candidate.d_down;
    return projector::OverlayPlace{candidate.p - 0.5 * (d_right + d_down), d_right, d_down};
  };
  // Whether the prototype covers the place and is flat there.
  const auto is_free = [&](const projector::OverlayPlace& place) {
    const double most = k_flat * place.d_right.norm();
    for (int i = 0; i <= k_nodes; ++i)
      for (int j = 0; j <= k_nodes; ++j) {
        const Eigen::Vector3d p =
            place.p_corner + 1.0 * i / k_nodes * place.d_right + 1.0 * j / k_nodes * place.d_down;
        const auto px = projector.project(world_from_prototype * p);
        if (!px || !projector.contains(*px)) return false;
        const auto there = point_at(points, cvRound(px->x()), cvRound(px->y()));
        if (!there || (*there - p).norm() > most) return false;
      }
    return true;
  };
  for (double px = points.cols; px >= least_px; px *= k_smaller)
    for (const Candidate& candidate : candidates)
      if (const projector::OverlayPlace place = place_at(candidate, px * candidate.m_per_px); is_free(place))
        return place;
  return std::nullopt;
}

}  // namespace limn::remote
