#include "projector/bake.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace limn::projector {
namespace {

constexpr int k_widest_step = 4;
constexpr double k_tolerance_px = 0.005;  // largest error of the table between its nodes
constexpr int k_probes = 24;              // points for each side of the image at which this is checked

cv::Vec2f tangent_of(const Eigen::Vector3f& d) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float k_least_z = 0.2f;  // 78 degrees off axis: beyond a pinhole image
  return d.z() > k_least_z ? cv::Vec2f(d.x() / d.z(), d.y() / d.z()) : cv::Vec2f(nan, nan);
}

cv::Mat tangents_every(const Imager& imager, int step) {
  const int width = imager.width + 2 * step, height = imager.height + 2 * step;
  const auto directions = direction_map(imager.lens, width, height, step);
  const int columns = (width + step - 1) / step;
  cv::Mat tangents(static_cast<int>(directions.size()) / columns, columns, CV_32FC2);
  std::transform(directions.begin(), directions.end(), tangents.begin<cv::Vec2f>(), tangent_of);
  return tangents;
}

// Reads the table bilinearly, as shaders/lens.glsl does.
Eigen::Vector2d read(const cv::Mat& tangents, int step, const Eigen::Vector2d& px) {
  const Eigen::Vector2d node = px / step;
  const int x = static_cast<int>(node.x()), y = static_cast<int>(node.y());
  const double fx = node.x() - x, fy = node.y() - y;
  const auto at = [&](int dx, int dy) {
    const auto& v = tangents.at<cv::Vec2f>(y + dy, x + dx);
    return Eigen::Vector2d(static_cast<double>(v[0]), static_cast<double>(v[1]));
  };
  return (1 - fy) * ((1 - fx) * at(0, 0) + fx * at(1, 0)) + fy * ((1 - fx) * at(0, 1) + fx * at(1, 1));
}

double worst_error_px(const Imager& imager, const cv::Mat& tangents, int step) {
  double worst = 0;
  for (int i = 0; i < k_probes * k_probes; ++i) {
    // Cell centres, where interpolation is worst.
    const int column = (i % k_probes) * (imager.width / step - 1) / k_probes;
    const int row = (i / k_probes) * (imager.height / step - 1) / k_probes;
    const Eigen::Vector2d px = (Eigen::Vector2d(column, row).array() + 0.5).matrix() * step;
    const auto d = imager.lens.unproject(px);
    if (!d || d->z() <= 0) continue;
    const Eigen::Vector2d read_tangent = read(tangents, step, px);
    if (!read_tangent.allFinite()) continue;
    worst = std::max(worst, imager.lens.fx() * (read_tangent - d->hnormalized()).norm());
  }
  return worst;
}

// The display value that gives `light`, interpolated between the measured levels. A level below an earlier
// one is replaced by the highest before it.
float display_value(const std::vector<double>& levels, double light) {
  double before = levels.front();
  if (light <= before) return 0;
  for (std::size_t i = 1; i < levels.size(); ++i) {
    const double level = std::max(before, levels[i]);
    if (light <= level && level > before) {
      const double at = static_cast<double>(i - 1) + (light - before) / (level - before);
      return static_cast<float>(at / static_cast<double>(levels.size() - 1));
    }
    before = level;
  }
  return 1;
}

}  // namespace

BakedLens baked(const Imager& imager) {
  BakedLens lens;
  for (lens.step = k_widest_step; lens.step >= 1; lens.step /= 2) {
    lens.tangents = tangents_every(imager, lens.step);
    if (lens.step == 1 || worst_error_px(imager, lens.tangents, lens.step) <= k_tolerance_px) break;
  }
  const double infinity = std::numeric_limits<double>::infinity();
  lens.rect = {Eigen::Vector2d::Constant(infinity), Eigen::Vector2d::Constant(-infinity)};
  for (auto it = lens.tangents.begin<cv::Vec2f>(); it != lens.tangents.end<cv::Vec2f>(); ++it) {
    const Eigen::Vector2d tangent((*it)[0], (*it)[1]);
    if (!tangent.allFinite()) continue;
    lens.rect.lower = lens.rect.lower.cwiseMin(tangent);
    lens.rect.upper = lens.rect.upper.cwiseMax(tangent);
  }
  // The first nodes are pixel centres; the image begins half a pixel before them.
  const Eigen::Vector2d half_pixel(0.5 / imager.lens.fx(), 0.5 / imager.lens.fy());
  lens.rect.lower -= 2 * half_pixel;
  return lens;
}

cv::Mat pixel_map(const Imager& imager, const TangentRect& rect, int columns, int rows) {
  cv::Mat map(rows, columns, CV_32FC2);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector2d share(1.0 * column / (columns - 1), 1.0 * row / (rows - 1));
      const Eigen::Vector2d tangent = rect.lower + (rect.upper - rect.lower).cwiseProduct(share);
      const auto px = imager.lens.project(tangent.homogeneous());
      map.at<cv::Vec2f>(row, column) =
          px ? cv::Vec2f(static_cast<float>(px->x()), static_cast<float>(px->y())) : cv::Vec2f(-1e6f, -1e6f);
    }
  }
  return map;
}

cv::Rect pixels_of(const Imager& imager, const BakedLens& lens, const TangentRect& rect) {
  constexpr int k_nodes = 17;        // nodes for each side; a lens bends lines little between them
  constexpr double k_margin_px = 4;  // for this bending, and because a pixel sees more than its centre
  const TangentRect visible = intersected(rect, lens.rect);
  if (visible.is_empty()) return {};
  Eigen::AlignedBox2d box;
  for (int row = 0; row < k_nodes; ++row)
    for (int column = 0; column < k_nodes; ++column) {
      const Eigen::Vector2d share(1.0 * column / (k_nodes - 1), 1.0 * row / (k_nodes - 1));
      const Eigen::Vector2d tangent = visible.lower + (visible.upper - visible.lower).cwiseProduct(share);
      if (const auto px = imager.lens.project(tangent.homogeneous())) box.extend(*px);
    }
  if (box.isEmpty()) return {0, 0, imager.width, imager.height};
  const auto whole = [](double value) { return static_cast<int>(std::clamp(value, -1e6, 1e6)); };
  const cv::Point first(whole(std::floor(box.min().x() - k_margin_px)),
                        whole(std::floor(box.min().y() - k_margin_px)));
  const cv::Point end(whole(std::ceil(box.max().x() + k_margin_px)),
                      whole(std::ceil(box.max().y() + k_margin_px)));
  return cv::Rect(first, end) & cv::Rect(0, 0, imager.width, imager.height);
}

cv::Mat response_table(const ProjectorResponse* response, int columns) {
  cv::Mat table(1, columns, CV_32FC3);
  for (int k = 0; k < columns; ++k) {
    const double light = std::pow(static_cast<double>(k) / (columns - 1), 2);
    auto& entry = table.at<cv::Vec3f>(0, k);
    entry = cv::Vec3f::all(static_cast<float>(std::pow(light, 1 / k_display_gamma)));
    if (!response) continue;
    const std::vector<double>* channels[] = {&response->red, &response->green, &response->blue};
    for (int c = 0; c < 3; ++c) {
      if (channels[c]->size() >= 2) entry[c] = display_value(*channels[c], light);
    }
  }
  return table;
}

}  // namespace limn::projector
