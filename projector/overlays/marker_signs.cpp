#include "projector/overlays/marker_signs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

namespace limn::projector {
namespace {

// In marker sides. Ring and word are well away from the marker's paper, so that their light does not hide the
// marker from cameras.
constexpr double k_ring_radius = 1.3, k_ring_width = 0.06;
constexpr double k_word_height = 0.45, k_word_gap = 0.95;
constexpr int k_font = cv::FONT_HERSHEY_DUPLEX;
constexpr double k_font_scale = 2;

std::optional<cv::Point2f> pixel(const Imager& projector, const Pose& world_from_marker, double x, double y) {
  const auto px = projector.project(world_from_marker * Eigen::Vector3d(x, y, 0));
  if (!px) return std::nullopt;
  return cv::Point2f(static_cast<float>(px->x()), static_cast<float>(px->y()));
}

void add(const cv::Mat& light, cv::Mat* image) { cv::max(*image, light, *image); }

}  // namespace

double head_on(const Imager& projector, const Pose& world_from_marker) {
  const Pose projector_from_marker = projector.imager_from_world * world_from_marker;
  const auto px = projector.project(world_from_marker.translation);
  if (!px || !projector.contains(*px)) return 0;
  const Eigen::Vector3d d_sight = projector_from_marker.translation.normalized();
  return std::max(0.0, (projector_from_marker.rotation * Eigen::Vector3d::UnitZ()).dot(d_sight));
}

void draw_ring(const Imager& projector,
               const Pose& world_from_marker,
               double size_m,
               const cv::Scalar& colour,
               double strength,
               cv::Mat* image) {
  constexpr int k_points = 72, k_shift = 4;
  std::vector<cv::Point> outline;
  for (const double radius : {k_ring_radius, k_ring_radius + k_ring_width}) {
    for (int i = 0; i <= k_points; ++i) {
      const double angle = 2 * std::numbers::pi * i / k_points * (radius == k_ring_radius ? 1 : -1);
      const auto px = pixel(projector, world_from_marker, radius * size_m * std::cos(angle),
                            radius * size_m * std::sin(angle));
      if (!px) return;
      outline.emplace_back(cvRound(px->x * (1 << k_shift)), cvRound(px->y * (1 << k_shift)));
    }
  }
  // Only the ring's own box is drawn: there may be many rings.
  const cv::Rect whole = cv::boundingRect(outline);
  const int margin = 2;
  const cv::Point corner((whole.x >> k_shift) - margin, (whole.y >> k_shift) - margin);
  const cv::Size size((whole.width >> k_shift) + 2 * margin + 2, (whole.height >> k_shift) + 2 * margin + 2);
  const cv::Rect box = cv::Rect(corner, size) & cv::Rect({}, image->size());
  if (box.empty()) return;
  for (cv::Point& p : outline) p -= box.tl() * (1 << k_shift);
  cv::Mat light(box.size(), image->type(), cv::Scalar::all(0));
  cv::fillPoly(light, std::vector<std::vector<cv::Point>>{outline}, colour * strength, cv::LINE_AA, k_shift);
  cv::Mat place = (*image)(box);
  add(light, &place);
}

void draw_word(const Imager& projector,
               const Pose& world_from_marker,
               double size_m,
               const std::string& word,
               double strength,
               cv::Mat* image) {
  if (word.empty()) return;
  int below = 0;
  const cv::Size text = cv::getTextSize(word, k_font, k_font_scale, 3, &below);
  const int border = 6;
  cv::Mat sheet(text.height + below + 2 * border, text.width + 2 * border, image->type(), cv::Scalar::all(0));
  cv::putText(sheet, word, {border, border + text.height}, k_font, k_font_scale,
              cv::Scalar::all(255 * strength), 3, cv::LINE_AA);
  const double height = k_word_height * size_m, width = height * sheet.cols / sheet.rows;
  const double bottom = -(0.5 + k_word_gap) * size_m, top = bottom - height;
  const std::vector<cv::Point2f> from = {{0, 0},
                                         {static_cast<float>(sheet.cols), 0},
                                         {static_cast<float>(sheet.cols), static_cast<float>(sheet.rows)},
                                         {0, static_cast<float>(sheet.rows)}};
  std::vector<cv::Point2f> to;
  for (const auto& [x, y] :
       {std::pair{-0.5 * width, top}, {0.5 * width, top}, {0.5 * width, bottom}, {-0.5 * width, bottom}}) {
    const auto px = pixel(projector, world_from_marker, x, y);
    if (!px) return;
    to.push_back(*px);
  }
  cv::Mat light;
  cv::warpPerspective(sheet, light, cv::getPerspectiveTransform(from, to), image->size(), cv::INTER_AREA);
  add(light, image);
}

}  // namespace limn::projector
