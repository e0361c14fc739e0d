#include "tests/tracker/ball_images.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace limn::test {
namespace {

constexpr int k_samples = 10;  // along a side of a pixel that an outline may cross

// The light of a ray from the camera, and which sphere it meets (-1: none).
struct Hit {
  int ball = -1;
  double light = 0;
};

double reflected(const PlacedBall& ball, const Eigen::Vector3d& normal) {
  if (ball.surface == BallSurface::flat) return ball.light;
  return ball.light * (ball.ambient + (1 - ball.ambient) * std::max(0.0, normal.dot(ball.d_to_light)));
}

Hit hit_of(std::span<const PlacedBall> balls,
           const std::vector<std::size_t>& which,
           const Eigen::Vector3d& ray) {
  const Eigen::Vector3d d = ray.normalized();
  Hit hit;
  double nearest = std::numeric_limits<double>::infinity();
  for (const std::size_t i : which) {
    const PlacedBall& ball = balls[i];
    const double along = ball.p_camera.dot(d);
    const double square = ball.radius_m * ball.radius_m - (ball.p_camera - along * d).squaredNorm();
    if (!(square > 0)) continue;
    const double distance = along - std::sqrt(square);
    if (!(distance > 0 && distance < nearest)) continue;
    nearest = distance;
    hit = {static_cast<int>(i), reflected(ball, (distance * d - ball.p_camera) / ball.radius_m)};
  }
  return hit;
}

// The directions of a pixel and of the steps to its neighbours.
struct PixelRays {
  Eigen::Vector3d d, by_x, by_y;
  Eigen::Vector3d at(double x, double y) const { return d + x * by_x + y * by_y; }
};

double pixel_light(const PixelRays& rays,
                   double background,
                   std::span<const PlacedBall> balls,
                   const std::vector<std::size_t>& which) {
  double sum = 0;
  for (int i = 0; i < k_samples; ++i)
    for (int k = 0; k < k_samples; ++k) {
      const Hit hit = hit_of(balls, which, rays.at((i + 0.5) / k_samples - 0.5, (k + 0.5) / k_samples - 0.5));
      sum += hit.ball < 0 ? background : hit.light;
    }
  return sum / (k_samples * k_samples);
}

}  // namespace

cv::Mat light_of(const Lens& lens, const cv::Mat& background, std::span<const PlacedBall> balls) {
  cv::Mat light;
  background.convertTo(light, CV_32F);
  std::vector<cv::Rect> boxes;
  for (const PlacedBall& ball : balls) {
    // The box of points on the outline's cone, with a margin.
    const double angle = std::asin(ball.radius_m / ball.p_camera.norm());
    const Eigen::Vector3d axis = ball.p_camera.normalized(), a = axis.unitOrthogonal(), b = axis.cross(a);
    Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
    for (int i = 0; i < 64; ++i) {
      const double turn = 2 * M_PI * i / 64;
      const auto px =
          lens.project(std::cos(angle) * axis + std::sin(angle) * (std::cos(turn) * a + std::sin(turn) * b));
      if (px) low = low.cwiseMin(*px), high = high.cwiseMax(*px);
    }
    const cv::Rect box(static_cast<int>(low.x()) - 3, static_cast<int>(low.y()) - 3,
                       static_cast<int>(high.x() - low.x()) + 7, static_cast<int>(high.y() - low.y()) + 7);
    boxes.push_back(box & cv::Rect(0, 0, light.cols, light.rows));
  }
  for (std::size_t k = 0; k < boxes.size(); ++k)
    for (int y = boxes[k].y; y < boxes[k].br().y; ++y)
      for (int x = boxes[k].x; x < boxes[k].br().x; ++x) {
        std::vector<std::size_t> which;
        for (std::size_t i = 0; i < boxes.size(); ++i)
          if (boxes[i].contains({x, y})) which.push_back(i);
        if (which.front() != k) continue;  // drawn already
        const auto d = lens.unproject({x, y});
        const auto right = lens.unproject({x + 0.5, y}), left = lens.unproject({x - 0.5, y});
        const auto down = lens.unproject({x, y + 0.5}), up = lens.unproject({x, y - 0.5});
        light.at<float>(y, x) = static_cast<float>(
            pixel_light({*d, *right - *left, *down - *up}, light.at<float>(y, x), balls, which));
      }
  return light;
}

cv::Mat image_of(const Lens& lens,
                 const cv::Mat& background,
                 std::span<const PlacedBall> balls,
                 const ImageOptions& options,
                 std::mt19937_64& rng) {
  cv::Mat light = light_of(lens, background, balls);
  if (options.blur_px > 0) cv::GaussianBlur(light, light, {}, options.blur_px);
  return noisy_grey(light, options.noise_levels, rng);
}

}  // namespace limn::test
