#include "calib/report/deviation_views.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/surface/deviation_scale.h"
#include "core/imager.h"
#include "scene/meshes/scan_preview.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t k_most_views = 4;
constexpr double k_least_gain = 0.08;  // share of the measured area; a view that shows less new is left out
constexpr double k_seen_cosine = 0.3;  // surfaces that are seen more obliquely do not count
constexpr int k_hatch_px = 11;         // distance of the hatching's lines
constexpr int k_hatch_line_px = 4;
const cv::Scalar k_paper_bgr(250, 249, 248);

// The sides from which a surface is usually seen: along axes and between them.
std::vector<Vector3d> sides() {
  std::vector<Vector3d> all;
  for (int k = 0; k < 27; ++k) {
    const Vector3d d(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
    if (d.squaredNorm() > 0) all.push_back(d.normalized());
  }
  return all;
}

std::string side_text(const Vector3d& d) {
  std::string text;
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(d[axis]) > 0.2)
      text += fmt::format("{}{}{}", text.empty() ? "" : " ", d[axis] > 0 ? '+' : '-', "xyz"[axis]);
  return text;
}

// How well a point is seen from a side: the cosine, or 0.
double seen_from(const Deviation& deviation, std::size_t i, const Vector3d& d) {
  const double cosine = deviation.cad.surface.normals[i].cast<double>().dot(d);
  return cosine > k_seen_cosine ? cosine : 0;
}

// The sides that together show the most of the measured area, the best one first.
std::vector<Vector3d> chosen_sides(const Deviation& deviation) {
  std::vector<Vector3d> chosen;
  std::vector<double> best(deviation.states.size(), 0);
  double whole = 0;
  for (std::size_t i = 0; i < best.size(); ++i)
    if (deviation.has(i)) whole += static_cast<double>(deviation.cad.areas_m2[i]);
  while (chosen.size() < k_most_views) {
    double most = 0;
    Vector3d d_most = Vector3d::UnitZ();
    for (const Vector3d& d : sides()) {
      double gain = 0;
      for (std::size_t i = 0; i < best.size(); ++i)
        if (deviation.has(i))
          gain += static_cast<double>(deviation.cad.areas_m2[i]) *
                  std::max(0.0, seen_from(deviation, i, d) - best[i]);
      if (gain > most) most = gain, d_most = d;
    }
    if (most < k_least_gain * whole) break;
    chosen.push_back(d_most);
    for (std::size_t i = 0; i < best.size(); ++i)
      best[i] = std::max(best[i], seen_from(deviation, i, d_most));
  }
  return chosen;
}

// A point of the CAD in the image.
struct ViewCorner {
  Vector2d px = Vector2d::Zero();
  double inverse_depth = 0;
  double light = 0;  // <= 0: seen from behind
  bool seen = false;
};

class ViewCanvas {
 public:
  ViewCanvas(const Deviation& deviation, const Imager& viewer)
      : deviation_(deviation),
        image_(viewer.height, viewer.width, CV_8UC3, k_paper_bgr),
        nearest_(viewer.height, viewer.width, CV_64F, cv::Scalar(0)) {
    const Vector3d p_eye = viewer.imager_from_world.inverse().translation;
    corners_.resize(deviation.states.size());
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const Vector3d p = deviation.cad.surface.positions[i].cast<double>();
      const double depth = (viewer.imager_from_world * p).z();
      const auto px = viewer.project(p);
      if (!px || depth <= 0) continue;
      corners_[i] = {*px, 1 / depth,
                     deviation.cad.surface.normals[i].cast<double>().dot((p_eye - p).normalized()), true};
    }
  }

  void draw() {
    for (const auto& triangle : deviation_.cad.surface.triangles) fill(triangle);
  }

  // Whether a point is the nearest one in its pixel, or almost.
  bool is_visible(std::size_t i) const {
    constexpr double k_same_depth = 5e-3;  // share
    const ViewCorner& corner = corners_[i];
    const cv::Point px(static_cast<int>(std::lround(corner.px.x())),
                       static_cast<int>(std::lround(corner.px.y())));
    return corner.seen && corner.light > 0 && cv::Rect({}, image_.size()).contains(px) &&
           corner.inverse_depth > (1 - k_same_depth) * nearest_.at<double>(px);
  }

  // Where the CAD is, with a margin.
  cv::Rect box() const {
    constexpr int k_margin_px = 40;
    const cv::Rect whole({}, image_.size()), box = cv::boundingRect(nearest_ > 0);
    return cv::Rect(box.tl() - cv::Point(k_margin_px, k_margin_px),
                    box.br() + cv::Point(k_margin_px, k_margin_px)) &
           whole;
  }

  const Vector2d& px(std::size_t i) const { return corners_[i].px; }
  const cv::Mat& image() const { return image_; }

 private:
  // The colour at a place of a triangle: `at` is the corner with the largest weight.
  Vector3d colour(
      const std::array<std::uint32_t, 3>& t, const Vector3d& weights, std::uint32_t at, int x, int y) const {
    constexpr double k_from_behind = 0.45;
    double light = 0, distance = 0;
    bool all = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double weight = weights[static_cast<Eigen::Index>(k)];
      light += weight * corners_[t[k]].light;
      all = all && deviation_.has(t[k]);
      distance += weight * static_cast<double>(deviation_.distances_m[t[k]]);
    }
    const auto shaded = [&](const std::array<std::uint8_t, 3>& rgb, double by) {
      return Vector3d(by * Vector3d(rgb[2], rgb[1], rgb[0]));
    };
    if (light <= 0) return shaded(k_not_measured_rgb, k_from_behind);
    const double by = 0.5 + 0.5 * std::min(1.0, light);
    if (!deviation_.has(at)) return shaded(k_not_measured_rgb, by);
    if (!all) distance = static_cast<double>(deviation_.distances_m[at]);
    const Vector3d plain = shaded(band_colour_rgb(deviation_band(distance, deviation_.tolerance_m)), by);
    const bool is_line = (x + y) % k_hatch_px < k_hatch_line_px;
    if (deviation_.states[at] == DeviationState::uncertain && is_line) return {40, 36, 34};
    return plain;
  }

  void fill(const std::array<std::uint32_t, 3>& t) {
    const ViewCorner &a = corners_[t[0]], &b = corners_[t[1]], &c = corners_[t[2]];
    if (!a.seen || !b.seen || !c.seen) return;
    const auto cross2 = [](const Vector2d& u, const Vector2d& v) { return u.x() * v.y() - u.y() * v.x(); };
    const double area = cross2(b.px - a.px, c.px - a.px);
    if (std::abs(area) < 1e-12) return;
    const Vector2d low = a.px.cwiseMin(b.px).cwiseMin(c.px), high = a.px.cwiseMax(b.px).cwiseMax(c.px);
    const int x0 = std::max(0, static_cast<int>(std::ceil(low.x()))),
              y0 = std::max(0, static_cast<int>(std::ceil(low.y())));
    const int x1 = static_cast<int>(std::floor(std::min<double>(high.x(), image_.cols - 1)));
    const int y1 = static_cast<int>(std::floor(std::min<double>(high.y(), image_.rows - 1)));
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        const Vector2d p(x, y);
        const double u = cross2(p - a.px, c.px - a.px) / area, v = cross2(b.px - a.px, p - a.px) / area;
        if (u < 0 || v < 0 || u + v > 1) continue;
        const Vector3d weights(1 - u - v, u, v);
        const double depth = weights.dot(Vector3d(a.inverse_depth, b.inverse_depth, c.inverse_depth));
        if (depth <= nearest_.at<double>(y, x)) continue;
        nearest_.at<double>(y, x) = depth;
        Eigen::Index most = 0;
        weights.maxCoeff(&most);
        const Vector3d bgr = colour(t, weights, t[static_cast<std::size_t>(most)], x, y);
        for (int k = 0; k < 3; ++k) image_.at<cv::Vec3b>(y, x)[k] = cv::saturate_cast<uchar>(bgr[k]);
      }
  }

  const Deviation& deviation_;
  cv::Mat image_, nearest_;  // `nearest_` holds inverse depths
  std::vector<ViewCorner> corners_;
};

// A ring with the extreme's number and its mm beside it.
void mark(cv::Mat& image, const Vector2d& px, std::size_t number, double distance_m) {
  const cv::Point at(static_cast<int>(std::lround(px.x())), static_cast<int>(std::lround(px.y())));
  const std::string text = fmt::format("{}: {:+.2f} mm", number, 1e3 * distance_m);
  constexpr double k_size = 0.9;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, k_size, 2, nullptr);
  const bool is_left = at.x + 24 + size.width > image.cols;
  const cv::Point foot(is_left ? std::max(4, at.x - 20 - size.width) : at.x + 20,
                       std::max(at.y - 12, size.height + 4));
  const cv::Scalar white(255, 255, 255), ink(25, 22, 20);
  for (const auto& [colour, wider] : {std::pair{white, 4}, std::pair{ink, 0}}) {
    cv::circle(image, at, 12, colour, 2 + wider, cv::LINE_AA);
    cv::putText(image, text, foot, cv::FONT_HERSHEY_SIMPLEX, k_size, colour, 2 + wider, cv::LINE_AA);
  }
}

}  // namespace

std::vector<DeviationView> deviation_views(const Deviation& deviation,
                                           std::span<const DeviationExtreme> extremes,
                                           int width,
                                           int height) {
  scene::ScanSurface measured;  // what the image is framed for
  for (std::size_t i = 0; i < deviation.states.size(); ++i)
    if (deviation.has(i)) measured.positions.push_back(deviation.cad.surface.positions[i]);
  std::vector<DeviationView> views;
  for (const Vector3d& d : chosen_sides(deviation)) {
    const Vector3d up = std::abs(d.y()) < 0.9 ? Vector3d::UnitY() : Vector3d::UnitZ();
    ViewCanvas canvas(deviation, scene::preview_viewer(measured, d, up, width, height));
    canvas.draw();
    const cv::Rect box = canvas.box();
    cv::Mat image = canvas.image()(box).clone();
    for (std::size_t k = 0; k < extremes.size(); ++k)
      if (canvas.is_visible(extremes[k].sample))
        mark(image, canvas.px(extremes[k].sample) - Vector2d(box.x, box.y), k + 1, extremes[k].distance_m);
    views.push_back({side_text(d), std::move(image)});
  }
  return views;
}

}  // namespace limn::calib
