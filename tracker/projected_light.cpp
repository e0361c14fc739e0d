#include "tracker/projected_light.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/result.h"

namespace limn::tracker {
namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();

int on_grid(int pixels) { return (pixels + k_light_step - 1) / k_light_step; }

// Distance along the ray to the plate; nullopt beside it or from behind.
std::optional<double> hit(const Plate& plate,
                          const Pose& plate_from_world,
                          const Eigen::Vector3d& p_eye,
                          const Eigen::Vector3d& d) {
  const Eigen::Vector3d p = plate_from_world * p_eye, direction = plate_from_world.rotation * d;
  if (!(direction.z() > 0) || !(p.z() < 0)) return std::nullopt;
  const double distance = -p.z() / direction.z();
  const Eigen::Vector3d at = p + distance * direction;
  if (std::abs(at.x()) > plate.half_size.x() || std::abs(at.y()) > plate.half_size.y()) return std::nullopt;
  return distance;
}

Eigen::Vector3d point(const cv::Mat& points, int row, int column) {
  const auto& p =
      points.at<cv::Vec3f>(std::clamp(row, 0, points.rows - 1), std::clamp(column, 0, points.cols - 1));
  return {p[0], p[1], p[2]};
}

// Normal of the surface between its neighbours on the grid, towards the camera (x right, y down: x cross y is
// inward).
Eigen::Vector3d normal(const cv::Mat& points, int row, int column) {
  Eigen::Vector3d dx = point(points, row, column + 1) - point(points, row, column - 1);
  Eigen::Vector3d dy = point(points, row + 1, column) - point(points, row - 1, column);
  if (!dx.allFinite()) dx = point(points, row, column + 1) - point(points, row, column);
  if (!dx.allFinite()) dx = point(points, row, column) - point(points, row, column - 1);
  if (!dy.allFinite()) dy = point(points, row + 1, column) - point(points, row, column);
  if (!dy.allFinite()) dy = point(points, row, column) - point(points, row - 1, column);
  return dy.cross(dx).normalized();
}

// A grid's values at every pixel of the camera's image; entry (r, c) belongs to pixel (c, r) *
// k_light_step.
cv::Mat at_every_pixel(const cv::Mat& grid, const cv::Size& size) {
  cv::Mat x(size, CV_32FC1), y(size, CV_32FC1), out;
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column) {
      x.at<float>(row, column) = static_cast<float>(column) / k_light_step;
      y.at<float>(row, column) = static_cast<float>(row) / k_light_step;
    }
  cv::remap(grid, out, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return out;
}

// Per grid entry: the projector's pixel (x, y) and the share of its light that arrives at 1 m head on.
cv::Mat arriving(const Imager& projector, const cv::Mat& points) {
  cv::Mat arrival(points.size(), CV_32FC3, cv::Scalar(-1e4, -1e4, 0));
  const Eigen::Vector3d p_projector = projector.imager_from_world.inverse().translation;
  for (int row = 0; row < points.rows; ++row)
    for (int column = 0; column < points.cols; ++column) {
      const Eigen::Vector3d p = point(points, row, column);
      if (!p.allFinite()) continue;
      const auto px = projector.project(p);
      const Eigen::Vector3d d = p_projector - p;
      const double cosine = normal(points, row, column).dot(d.normalized());
      if (!px || !(cosine > 0) || px->cwiseAbs().maxCoeff() > 1e4) continue;
      arrival.at<cv::Vec3f>(row, column) = cv::Vec3f(static_cast<float>(px->x()), static_cast<float>(px->y()),
                                                     static_cast<float>(cosine / d.squaredNorm()));
    }
  return arrival;
}

// Differences between pixels k_apart to the right and below, where the light changes.
struct Gradient {
  float log_level, light, light_beside;
};

constexpr float k_least_level = 4;      // below it the logarithm is noise
constexpr float k_most_level = 250;     // above it pixels clip
constexpr float k_least_change = 0.1f;  // of the light's own range
constexpr int k_apart = 5;              // pixels: further than blur and a light that is a pixel off reach
constexpr std::size_t k_enough = 50000;

std::vector<Gradient> gradients(const cv::Mat& level, const cv::Mat& light) {
  double brightest = 0;
  cv::minMaxLoc(light, nullptr, &brightest);
  const float change = k_least_change * static_cast<float>(brightest);
  std::vector<Gradient> found;
  const auto usable = [&](float v) { return v > k_least_level && v < k_most_level; };
  for (int row = 0; row + k_apart < level.rows; ++row)
    for (int column = 0; column + k_apart < level.cols; ++column)
      for (const auto& [y, x] : {std::pair(row, column + k_apart), std::pair(row + k_apart, column)}) {
        const float a = level.at<float>(row, column), b = level.at<float>(y, x);
        const float la = light.at<float>(row, column), lb = light.at<float>(y, x);
        if (std::abs(la - lb) > change && usable(a) && usable(b)) found.push_back({std::log(a / b), la, lb});
      }
  if (found.size() <= k_enough) return found;
  std::vector<Gradient> thinned;
  for (std::size_t i = 0; i < k_enough; ++i) thinned.push_back(found[i * found.size() / k_enough]);
  return thinned;
}

double unexplained(const std::vector<Gradient>& gradients, double gain) {
  double sum = 0;
  for (const Gradient& g : gradients)
    sum += std::abs(g.log_level - std::log((1 + gain * g.light) / (1 + gain * g.light_beside)));
  return sum;
}

// From light that is a hundredth of the room's to a hundred times it, in steps of a fifth, then of a
// hundredth.
double best_gain(const std::vector<Gradient>& gradients, double brightest) {
  double best = 0, least = unexplained(gradients, 0);
  const auto search = [&](double from, double to, double step) {
    for (double gain = from; gain < to; gain *= step) {
      const double value = unexplained(gradients, gain);
      if (value >= least) continue;
      least = value;
      best = gain;
    }
  };
  search(0.01 / brightest, 100 / brightest, 1.2);
  if (best > 0) search(best / 1.2, best * 1.2, 1.01);
  return best;
}

}  // namespace

cv::Mat points_seen(const Imager& camera, std::span<const Plate> plates, const cv::Mat& behind) {
  const cv::Size size(on_grid(camera.width), on_grid(camera.height));
  LIMN_CHECK(behind.empty() || (behind.size() == size && behind.type() == CV_32FC3));
  cv::Mat points = behind.empty() ? cv::Mat(size, CV_32FC3, cv::Scalar::all(k_nan)) : behind.clone();
  const auto directions = direction_map(camera.lens, camera.width, camera.height, k_light_step);
  const Pose world_from_camera = camera.imager_from_world.inverse();
  const Eigen::Vector3d& p_eye = world_from_camera.translation;
  std::vector<Pose> plate_from_world;
  for (const Plate& plate : plates) plate_from_world.push_back(plate.world_from_plate.inverse());
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column) {
      const Eigen::Vector3f& d_camera = directions[static_cast<std::size_t>(row * size.width + column)];
      const Eigen::Vector3d d = world_from_camera.rotation * d_camera.cast<double>();
      double nearest = (point(points, row, column) - p_eye).norm();
      if (!std::isfinite(nearest)) nearest = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < plates.size(); ++i) {
        const auto distance = hit(plates[i], plate_from_world[i], p_eye, d);
        if (!distance || *distance > nearest) continue;
        nearest = *distance;
        const Eigen::Vector3f p = (p_eye + nearest * d).cast<float>();
        points.at<cv::Vec3f>(row, column) = cv::Vec3f(p.x(), p.y(), p.z());
      }
    }
  return points;
}

cv::Mat light_seen(const Imager& camera,
                   const cv::Mat& points,
                   std::span<const ShownLight> shown,
                   double blur_px) {
  const cv::Size size(camera.width, camera.height);
  cv::Mat sum = cv::Mat::zeros(size, CV_32FC1);
  for (const ShownLight& source : shown) {
    LIMN_CHECK(source.light.type() == CV_32FC1);
    cv::Mat planes[3], light;
    cv::split(arriving(*source.projector, points), planes);
    for (cv::Mat& plane : planes) plane = at_every_pixel(plane, size);
    cv::remap(source.light, light, planes[0], planes[1], cv::INTER_LINEAR, cv::BORDER_CONSTANT,
              cv::Scalar(0));
    sum += light.mul(planes[2]);
  }
  if (blur_px > 0) cv::GaussianBlur(sum, sum, {0, 0}, blur_px);
  return sum;
}

Discounted discounted(const cv::Mat& grey, const cv::Mat& light, double black_level) {
  LIMN_CHECK(grey.type() == CV_8UC1 && light.type() == CV_32FC1 && grey.size() == light.size());
  double brightest = 0;
  cv::minMaxLoc(light, nullptr, &brightest);
  if (!(brightest > 0)) return {grey, 0};
  cv::Mat level;
  grey.convertTo(level, CV_32F, 1, -black_level);
  const double gain = best_gain(gradients(level, light), brightest);
  if (gain == 0) return {grey, 0};
  const cv::Mat lit = 1 + gain * light;
  // As if everything stood in the image's mean light, so that levels keep their range.
  const double mean = cv::mean(lit)[0];
  cv::Mat even, out;
  cv::divide(level, lit, even, mean);
  even.convertTo(out, CV_8U, 1, black_level);
  return {out, gain};
}

}  // namespace limn::tracker
