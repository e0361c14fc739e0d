#include "sim/directions.h"

#include <algorithm>
#include <array>
#include <limits>
#include <opencv2/core.hpp>

namespace limn::sim {
namespace {

constexpr int k_direction_step = 8;  // pixels between exact directions

std::array<double, 4> weights(double t) {
  return {((-0.5 * t + 1) * t - 0.5) * t, ((1.5 * t - 2.5) * t) * t + 1, ((-1.5 * t + 2) * t + 0.5) * t,
          ((0.5 * t - 0.5) * t) * t};
}

}  // namespace

Directions::Directions(const Imager& imager)
    : columns_(imager.width / k_direction_step + 5), rows_(imager.height / k_direction_step + 5) {
  knots_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  const Eigen::Matrix3d world_from_imager = imager.imager_from_world.inverse().rotation_matrix();
  cv::parallel_for_({0, rows_}, [&](const cv::Range& range) {
    for (int r = range.start; r < range.end; ++r)
      for (int c = 0; c < columns_; ++c) {
        const Eigen::Vector2d px((c - 2) * k_direction_step, (r - 2) * k_direction_step);
        const auto d = imager.lens.unproject(px);
        knots_[index(r, c)] = d ? Eigen::Vector3d(world_from_imager * *d)
                                : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
      }
  });
}

Eigen::Vector3f Directions::at(double x, double y) const {
  const double cx = x / k_direction_step + 2, cy = y / k_direction_step + 2;
  const int c = static_cast<int>(cx), r = static_cast<int>(cy);
  const std::array<double, 4> wx = weights(cx - c), wy = weights(cy - r);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int j = 0; j < 4; ++j) {
    Eigen::Vector3d row = Eigen::Vector3d::Zero();
    for (int i = 0; i < 4; ++i) row += wx[static_cast<std::size_t>(i)] * knots_[index(r - 1 + j, c - 1 + i)];
    sum += wy[static_cast<std::size_t>(j)] * row;
  }
  return sum.normalized().cast<float>();
}

void Directions::row(double x0, double y, std::span<Eigen::Vector3f> d) const {
  const double cy = y / k_direction_step + 2;
  const int r = static_cast<int>(cy);
  const std::array<double, 4> wy = weights(cy - r);
  std::vector<Eigen::Vector3d> knots(static_cast<std::size_t>(columns_), Eigen::Vector3d::Zero());
  const int first = static_cast<int>(x0 / k_direction_step + 2) - 1;
  const int last = static_cast<int>((x0 + static_cast<double>(d.size())) / k_direction_step + 2) + 2;
  for (int c = std::max(0, first); c <= std::min(columns_ - 1, last); ++c)
    for (int j = 0; j < 4; ++j)
      knots[static_cast<std::size_t>(c)] += wy[static_cast<std::size_t>(j)] * knots_[index(r - 1 + j, c)];
  for (std::size_t i = 0; i < d.size(); ++i) {
    const double cx = (x0 + static_cast<double>(i)) / k_direction_step + 2;
    const auto c = static_cast<std::size_t>(cx);
    const std::array<double, 4> wx = weights(cx - static_cast<double>(c));
    const Eigen::Vector3d sum =
        wx[0] * knots[c - 1] + wx[1] * knots[c] + wx[2] * knots[c + 1] + wx[3] * knots[c + 2];
    d[i] = sum.normalized().cast<float>();
  }
}

}  // namespace limn::sim
