#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "tests/tracker/seen_balls.h"
#include "tests/tracker/seen_body.h"
#include "tracker/balls/constellation_filter.h"

namespace limn::test {

/// What was reported of two constellations that cross in front of one camera.
struct Crossings {
  int frames = 0;
  int visible = 0;    ///< constellations of which all balls were found, at most two a frame
  int reported = 0;   ///< poses, at most two a frame
  int swapped = 0;    ///< nearer to the other constellation than to its own, and not within 20 mm of its own
  int elsewhere = 0;  ///< farther than 20 mm from both
};

/// Two triangles that two hands move to and fro through each other's paths at 60 frames a second. One camera
/// sees their balls with noise; balls whose outlines touch in the image are missing.
inline Crossings crossings(int frames, std::mt19937_64& rng) {
  const Imager camera = camera_1080p();
  const HandMotion hand(Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.6}), rng);
  const HandMotion other_hand(Pose(exp_rotation({0, 0, 0.4}), {0.05, 0.02, 1.65}), rng);
  const std::vector<Constellation> constellations = {triangle(), other_triangle()};
  Crossings count;
  std::vector<tracker::BodyFilter> known;
  const Stamp start = Stamp{} + std::chrono::seconds(1);
  for (int i = 0; i < frames; ++i) {
    const Stamp at = shifted(start, i / 60.0);
    const std::vector<PlacedConstellation> all = {{constellations[0], hand.at(i / 60.0)},
                                                  {constellations[1], other_hand.at(i / 60.0)}};
    const std::vector<tracker::Ball> balls = balls_seen(all, camera, 0.03, rng);
    for (const PlacedConstellation& one : all)
      count.visible += std::ranges::all_of(placed_balls({one}, camera), [&](const PlacedBall& ball) {
        const Eigen::Vector2d px = camera.lens.project(ball.p_camera).value();
        return std::ranges::any_of(
            balls, [&](const tracker::Ball& found) { return (found.centre_px - px).norm() < 1; });
      });
    const tracker::BallView view{&camera, balls};
    known = tracker::observed(known, constellations, std::span(&view, 1), at);
    ++count.frames;
    for (const tracker::BodyFilter& body : known) {
      if (body.measured_at != at || body.images_to_confirm > 0) continue;
      ++count.reported;
      const std::size_t own = body.body == constellations[0].name ? 0 : 1;
      const Eigen::Vector3d p = body.branches.front().moving.world_from_body.translation;
      const double off = (p - all[own].world_from_body.translation).norm();
      const double off_other = (p - all[1 - own].world_from_body.translation).norm();
      if (off < 0.02) continue;
      ++(off_other < off ? count.swapped : count.elsewhere);
    }
  }
  return count;
}

}  // namespace limn::test
