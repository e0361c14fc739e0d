// What is lost and swapped when two triangles of balls cross in front of one camera.
// Usage: balls_bench [FRAMES]

#include <cstdio>
#include <cstdlib>

#include "tests/tracker/crossing_balls.h"

int main(int count, char** arguments) {
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
