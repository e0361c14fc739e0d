#include "session/deviation/deviation_signs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "calib/surface/deviation_scale.h"

namespace limn::session {
namespace {

using Eigen::Vector3d;

constexpr int k_font = cv::FONT_HERSHEY_SIMPLEX;
// The height of numbers as a share of the prototype's diagonal, and its limits.
constexpr double k_height_share = 0.018, k_least_height_m = 0.006, k_most_height_m = 0.03;
constexpr int k_sign_height = 48;  // pixels of a number's image

cv::Mat number_image(double distance_m) {
  const std::string text = fmt::format("{:+.1f}", 1e3 * distance_m);
  constexpr double k_scale = 1.2;
  constexpr int k_thick = 2, k_border = 8;
  const cv::Size size = cv::getTextSize(text, k_font, k_scale, k_thick, nullptr);
  cv::Mat image(k_sign_height, size.width + 2 * k_border, CV_8UC3, cv::Scalar::all(0));
  cv::putText(image, text, {k_border, (k_sign_height + size.height) / 2}, k_font, k_scale,
              cv::Scalar::all(255), k_thick, cv::LINE_AA);
  return image;
}

// The tangent directions at a mark: right and down for somebody who looks at the surface.
std::pair<Vector3d, Vector3d> right_and_down(const Vector3d& n, const Vector3d& d_up) {
  Vector3d down = -(d_up - n * n.dot(d_up));
  if (down.norm() < 1e-3) down = n.unitOrthogonal();  // a horizontal surface has no up
  down.normalize();
  return {down.cross(-n), down};
}

// The first free place beside the mark.
std::optional<projector::OverlayPlace> free_place(const Vector3d& p,
                                                  const Vector3d& right,
                                                  const Vector3d& down,
                                                  double height_m,
                                                  double width_m,
                                                  const std::vector<Eigen::AlignedBox3d>& taken) {
  const double beside = 0.9 * height_m;  // from the mark to the number: the ring's radius
  const std::array<Vector3d, 4> corners = {
      p + beside * right - 0.5 * height_m * down, p - (beside + width_m) * right - 0.5 * height_m * down,
      p - 0.5 * width_m * right - (beside + height_m) * down, p - 0.5 * width_m * right + beside * down};
  for (const Vector3d& corner : corners) {
    Eigen::AlignedBox3d box(corner);
    box.extend(Vector3d(corner + width_m * right + height_m * down));
    const bool is_free =
        std::ranges::none_of(taken, [&](const Eigen::AlignedBox3d& other) { return box.intersects(other); });
    if (is_free) return projector::OverlayPlace{corner, width_m * right, height_m * down};
  }
  return std::nullopt;
}

void put_line(const std::string& text, const cv::Point& at, double scale, cv::Mat* image) {
  cv::putText(*image, text, at, k_font, scale, cv::Scalar::all(240), 1, cv::LINE_AA);
}

}  // namespace

std::vector<DeviationSign> deviation_signs(const scene::DeviationLayer& layer,
                                           const Eigen::AlignedBox3d& prototype_box,
                                           const Vector3d& d_up) {
  const double height_m =
      std::clamp(k_height_share * prototype_box.diagonal().norm(), k_least_height_m, k_most_height_m);
  std::vector<Eigen::AlignedBox3d> taken;
  for (const scene::DeviationLayer::Mark& mark : layer.marks) {
    const Vector3d half = Vector3d::Constant(0.4 * height_m);
    taken.emplace_back(mark.p_prototype - half, mark.p_prototype + half);
  }
  std::vector<DeviationSign> signs;
  for (const scene::DeviationLayer::Mark& mark : layer.marks) {
    const auto [right, down] = right_and_down(mark.d_normal.normalized(), d_up);
    Eigen::Matrix3d axes;
    axes << right, down, -mark.d_normal.normalized();
    DeviationSign sign;
    sign.prototype_from_mark = Pose(Eigen::Quaterniond(axes), mark.p_prototype);
    sign.size_m = 0.5 * height_m;
    sign.image = number_image(mark.distance_m);
    const double width_m = height_m * sign.image.cols / sign.image.rows;
    sign.place = free_place(mark.p_prototype, right, down, height_m, width_m, taken);
    if (const auto& place = sign.place) {
      Eigen::AlignedBox3d box(place->p_corner);
      box.extend(Vector3d(place->p_corner + place->d_right + place->d_down));
      taken.push_back(box);
    }
    signs.push_back(std::move(sign));
  }
  return signs;
}

cv::Mat with_legend(const cv::Mat& image, const scene::DeviationLayer& layer, double tolerance_m) {
  constexpr int k_bands = calib::k_deviation_bands, k_rows = 2 * k_bands + 3;  // and a title and the hatching
  const double scale = std::clamp(image.rows / 1000.0, 0.35, 1.0);
  const int line = cvRound(30 * scale), width = cvRound(240 * scale), pad = cvRound(8 * scale);
  cv::Mat out = image.clone();
  const cv::Rect box(pad, out.rows - pad - k_rows * line, width, k_rows * line);
  if ((box & cv::Rect({}, out.size())) != box) return out;  // too small an image
  out(box) *= 0.25;
  int y = box.y + line;
  const auto text_at = [&](int left) { return cv::Point(left, y - line / 3); };
  put_line("deviation from the CAD", text_at(box.x + pad), 0.55 * scale, &out);
  for (int band = k_bands; band >= -k_bands; --band) {
    y += line;
    const auto [r, g, b] = calib::band_colour_rgb(band);
    cv::rectangle(out, cv::Rect(box.x + pad, y - line + pad / 2, line, line - pad / 2), cv::Scalar(b, g, r),
                  cv::FILLED);
    put_line(calib::band_text(band, tolerance_m), text_at(box.x + 2 * pad + line), 0.55 * scale, &out);
  }
  y += line;
  cv::Mat hatched = out(cv::Rect(box.x + pad, y - line + pad / 2, line, line - pad / 2));
  for (int x = -line; x < line; x += std::max(4, line / 4))
    cv::line(hatched, {x, hatched.rows}, {x + hatched.rows, 0}, cv::Scalar::all(220), 1, cv::LINE_AA);
  put_line("uncertain", text_at(box.x + 2 * pad + line), 0.55 * scale, &out);
  if (!layer.unsure.empty()) {
    std::string unsure = "alignment unsure:";
    for (const std::string& direction : layer.unsure) unsure += " " + direction + ",";
    unsure.pop_back();
    put_line(unsure, {box.x, box.y - pad}, 0.6 * scale, &out);
  }
  return out;
}

}  // namespace limn::session
