#include "projector/room_image_levels.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "scene/room_image.h"

namespace limn::projector {
namespace {

using Eigen::Vector3d;

constexpr int k_columns = 512, k_rows = k_columns / 2;  // the size of every level
constexpr double k_least_roughness = 0.03;              // as in brdf_lut.cpp
// Columns that are computed of each level, and directions that are summed for each of their pixels. Rougher
// levels are smoother, so that fewer columns suffice; the rest is interpolated.
struct Effort {
  int columns, directions;
};
constexpr std::array<Effort, k_roughness_levels> k_efforts = {
    {{512, 1}, {512, 32}, {256, 128}, {128, 256}, {128, 256}, {64, 512}, {64, 512}, {64, 512}, {64, 512}}};
constexpr Effort k_diffuse_effort = {64, 512};

// A direction about the normal z, the share of its light, and the level of detail at which it is looked up.
struct Look {
  Vector3d d;
  float weight = 0;
  std::size_t detail = 0;
};

// Value i of the van der Corput sequence: any number of first values is spread evenly over 0 … 1.
double spread(unsigned i) {
  double sum = 0;
  for (double digit = 0.5; i > 0; i >>= 1, digit /= 2) sum += (i & 1) * digit;
  return sum;
}

// The image and its halves, a quarter of the pixels each.
std::vector<cv::Mat> details_of(const cv::Mat& light) {
  std::vector<cv::Mat> details(1);
  if (light.cols > k_columns)
    cv::resize(light, details[0], {k_columns, k_rows}, 0, 0, cv::INTER_AREA);
  else
    details[0] = light;
  while (details.back().rows >= 8) {
    cv::Mat half;
    cv::resize(details.back(), half, details.back().size() / 2, 0, 0, cv::INTER_AREA);
    details.push_back(half);
  }
  return details;
}

// The detail whose pixels are as large as the solid angle that a direction stands for.
std::size_t detail_for(double solid_angle, const std::vector<cv::Mat>& details) {
  const double pixel = 2 * std::pow(std::numbers::pi, 2) / static_cast<double>(details[0].total());
  const double level = std::round(0.5 * std::log2(std::max(1.0, solid_angle / pixel)));
  return std::min(static_cast<std::size_t>(level), details.size() - 1);
}

std::vector<Look> normalized(std::vector<Look> looks) {
  float sum = 0;
  for (const Look& look : looks) sum += look.weight;
  for (Look& look : looks) look.weight /= sum;
  return looks;
}

std::vector<Look> glossy_looks(double roughness, int count, const std::vector<cv::Mat>& details) {
  if (count == 1) return {{Vector3d::UnitZ(), 1, 0}};
  const double a2 = std::pow(std::max(roughness, k_least_roughness), 4);
  std::vector<Look> looks;
  for (int i = 0; i < count; ++i) {
    const double share = spread(static_cast<unsigned>(i)) + 0.5 / count,
                 angle = 2 * std::numbers::pi * (i + 0.5) / count;
    const double z = std::sqrt((1 - share) / (1 + (a2 - 1) * share)),
                 ring = std::sqrt(std::max(0.0, 1 - z * z));
    const Vector3d h(ring * std::cos(angle), ring * std::sin(angle), z), d = 2 * z * h - Vector3d::UnitZ();
    if (d.z() <= 0) continue;
    const double peak = z * z * (a2 - 1) + 1, density = a2 / (4 * std::numbers::pi * peak * peak);
    const double weight = d.z() / (d.z() + std::sqrt(d.z() * d.z() * (1 - a2) + a2));
    looks.push_back({d, static_cast<float>(weight), detail_for(1 / (count * density), details)});
  }
  return normalized(std::move(looks));
}

std::vector<Look> diffuse_looks(int count, const std::vector<cv::Mat>& details) {
  std::vector<Look> looks;
  for (int i = 0; i < count; ++i) {
    const double share = spread(static_cast<unsigned>(i)) + 0.5 / count,
                 angle = 2 * std::numbers::pi * (i + 0.5) / count;
    const double z = std::sqrt(1 - share), ring = std::sqrt(share);
    looks.push_back({{ring * std::cos(angle), ring * std::sin(angle), z},
                     1,
                     detail_for(std::numbers::pi / (count * std::max(z, 0.05)), details)});
  }
  return normalized(std::move(looks));
}

// The light of an image from a direction in its frame (right, up, ahead).
Eigen::Vector3f light_from(const cv::Mat& image, const Vector3d& d) {
  return scene::light_at(image, 0.5 + std::atan2(d.x(), d.z()) / (2 * std::numbers::pi),
                         std::acos(std::clamp(d.y(), -1.0, 1.0)) / std::numbers::pi);
}

cv::Mat summed(const std::vector<Look>& looks, int columns, const std::vector<cv::Mat>& details) {
  cv::Mat out(columns / 2, columns, CV_32FC3);
  cv::parallel_for_({0, out.rows}, [&](const cv::Range& rows) {
    for (int row = rows.start; row < rows.end; ++row)
      for (int column = 0; column < columns; ++column) {
        const double across = 2 * std::numbers::pi * ((column + 0.5) / columns - 0.5),
                     down = std::numbers::pi * (row + 0.5) / out.rows;
        const Vector3d n(std::sin(down) * std::sin(across), std::cos(down),
                         std::sin(down) * std::cos(across));
        const Vector3d d_u = n.unitOrthogonal(), d_v = n.cross(d_u);
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (const Look& look : looks)
          sum += look.weight *
                 light_from(details[look.detail], look.d.x() * d_u + look.d.y() * d_v + look.d.z() * n);
        out.at<cv::Vec3f>(row, column) = {sum.x(), sum.y(), sum.z()};
      }
  });
  return out;
}

// The same image with more pixels; it repeats to the sides.
cv::Mat enlarged(const cv::Mat& image) {
  if (image.cols == k_columns) return image;
  const int factor = k_columns / image.cols, beside = 4;
  cv::Mat wide, large;
  cv::copyMakeBorder(image, wide, beside, beside, 0, 0, cv::BORDER_REPLICATE);
  cv::copyMakeBorder(wide, wide, 0, 0, beside, beside, cv::BORDER_WRAP);
  cv::resize(wide, large, wide.size() * factor, 0, 0, cv::INTER_LINEAR);
  return large(cv::Rect(beside * factor, beside * factor, k_columns, k_rows)).clone();
}

}  // namespace

std::vector<cv::Mat> room_image_levels(const cv::Mat& light) {
  const std::vector<cv::Mat> details = details_of(light);
  std::vector<cv::Mat> levels;
  for (int k = 0; k < k_roughness_levels; ++k) {
    const Effort& effort = k_efforts[static_cast<std::size_t>(k)];
    const double roughness = std::pow(1.0 * k / (k_roughness_levels - 1), 1.5);
    levels.push_back(
        enlarged(summed(glossy_looks(roughness, effort.directions, details), effort.columns, details)));
  }
  levels.push_back(enlarged(
      summed(diffuse_looks(k_diffuse_effort.directions, details), k_diffuse_effort.columns, details)));
  return levels;
}

}  // namespace limn::projector
