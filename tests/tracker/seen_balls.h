#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/constellation.h"
#include "core/imager.h"
#include "tests/tracker/ball_images.h"
#include "tracker/balls/ball.h"

namespace limn::test {

/// Constellations of balls of 40 mm: two triangles, and one of five.
inline Constellation triangle() {
  return {"triangle", 0.02, {{-0.09, -0.05, 0}, {0.11, -0.05, 0}, {-0.01, 0.08, 0}}};
}
inline Constellation other_triangle() {
  return {"other", 0.02, {{-0.07, -0.04, 0}, {0.10, -0.04, 0}, {-0.04, 0.085, 0}}};
}
inline Constellation five_balls() {
  return {
      "five",
      0.02,
      {{-0.08, -0.06, 0}, {0.1, -0.05, 0.02}, {-0.02, 0.09, -0.01}, {0.05, 0.03, 0.08}, {-0.07, 0.02, 0.06}}};
}

/// A constellation and where it is.
struct PlacedConstellation {
  Constellation constellation;
  Pose world_from_body;
};

/// Its balls in a camera's frame, to be drawn.
inline std::vector<PlacedBall> placed_balls(const std::vector<PlacedConstellation>& all,
                                            const Imager& camera) {
  std::vector<PlacedBall> balls;
  for (const PlacedConstellation& one : all)
    for (const Eigen::Vector3d& p : one.constellation.p_balls) {
      PlacedBall ball;
      ball.p_camera = camera.imager_from_world * (one.world_from_body * p);
      ball.radius_m = one.constellation.radius_m;
      ball.surface = BallSurface::matt;
      balls.push_back(ball);
    }
  return balls;
}

/// What a finder would find of them: true outlines with Gaussian noise of the centre (px) and a tenth more of
/// the radius, and with that noise's covariance. Balls whose outlines touch are not found.
inline std::vector<tracker::Ball> balls_seen(const std::vector<PlacedConstellation>& all,
                                             const Imager& camera,
                                             double noise_px,
                                             std::mt19937_64& rng) {
  std::normal_distribution<double> noise(0, noise_px);
  std::vector<tracker::Ball> found;
  for (const PlacedBall& ball : placed_balls(all, camera)) {
    tracker::Ball one;
    const Eigen::Vector2d px = camera.lens.project(ball.p_camera).value();
    const double half_angle = std::asin(ball.radius_m / ball.p_camera.norm());
    const double px_per_radian = camera.lens.fx();
    one.centre_px = px + Eigen::Vector2d(noise(rng), noise(rng));
    one.d_centre = camera.lens.unproject(one.centre_px).value();
    one.centre_covariance = noise_px * noise_px * Eigen::Matrix2d::Identity();
    one.half_angle = half_angle + 1.1 * noise(rng) / px_per_radian;
    one.half_angle_stddev = std::max(1e-6, 1.1 * noise_px / px_per_radian);
    one.radius_px = half_angle * px_per_radian;
    one.contrast = 150;
    found.push_back(one);
  }
  std::vector<tracker::Ball> alone;
  for (std::size_t i = 0; i < found.size(); ++i) {
    bool touches = false;
    for (std::size_t k = 0; k < found.size(); ++k)
      touches |= i != k && (found[i].centre_px - found[k].centre_px).norm() <
                               found[i].radius_px + found[k].radius_px + 2;
    if (!touches) alone.push_back(found[i]);
  }
  std::shuffle(alone.begin(), alone.end(), rng);
  return alone;
}

}  // namespace limn::test
