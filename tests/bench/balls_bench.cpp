// What is lost and swapped when two triangles of balls cross in front of one camera.
// Usage: balls_bench [FRAMES]

#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "tests/tracker/crossing_balls.h"
#include "tracker/balls/ball_finder.h"

namespace {

// CPU time of finding the ten balls of an image of 1920x1080, in ms: the least of several runs.
double find_ms() {
  std::mt19937_64 rng(1);
  const limn::Imager camera = limn::test::camera_1080p();
  const limn::Pose left(Eigen::Quaterniond::Identity(), {-0.2, 0, 1.6}), right(left.rotation, {0.2, 0, 1.6});
  const auto balls =
      limn::test::placed_balls({{limn::test::five_balls(), left}, {limn::test::five_balls(), right}}, camera);
  const cv::Mat image = limn::test::image_of(camera.lens, limn::test::plain(1920, 1080, 40), balls,
                                             {.blur_px = 0.6, .noise_levels = 2}, rng);
  limn::tracker::BallFinder finder;
  double least = 1e9;
  for (int i = 0; i < 20; ++i) {
    const std::clock_t start = std::clock();
    finder.find(image, camera.lens);
    least = std::min(least, 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  }
  return least;
}

}  // namespace

int main(int count, char** arguments) {
  std::printf("finding 10 balls of 40 px in 1920x1080: %.2f ms\n", find_ms());
  const int frames = count > 1 ? std::atoi(arguments[1]) : 10000;
  int swapped = 0, elsewhere = 0, reported = 0, visible = 0, all = 0;
  constexpr int k_part = 1000;  // frames of one pair of hands
  for (int part = 0; part * k_part < frames; ++part) {
    std::mt19937_64 rng(static_cast<unsigned>(part));
    const limn::test::Crossings crossings = limn::test::crossings(k_part, rng);
    swapped += crossings.swapped, elsewhere += crossings.elsewhere, reported += crossings.reported;
    all += crossings.frames, visible += crossings.visible;
  }
  std::printf(
      "%d frames, all balls of a triangle visible in %.1f %%, reported %.1f %%, %d swapped, %d elsewhere\n",
      all, 50.0 * visible / all, 50.0 * reported / all, swapped, elsewhere);
  return swapped + elsewhere > 0 ? 1 : 0;
}
