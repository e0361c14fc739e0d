// No memory is asked for in a frame once the detector's buffers have grown to it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "tests/support/matchers.h"
#include "tests/tracker/marker_pictures.h"
#include "tracker/detector.h"

namespace {
long allocations = 0;
}

// Not inlined: half a pair would be taken for a mismatch.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace limn::tracker {
namespace {

TEST(Allocation, StopsAfterTheFirstFrame) {
  auto rng = test::test_rng();
  const Lens lens = Lens::pinhole(600, 600, 319.5, 239.5);
  std::vector<test::PlacedMarker> markers;
  for (int i = 0; i < 4; ++i)
    markers.push_back(test::placed(lens, {"apriltag_36h11", std::to_string(i)}, {100.0 + 140 * i, 240}, 80,
                                   0.3 * i, 0.4, 0.7 * i));
  const cv::Mat grey = test::picture_of(lens, test::clutter(640, 480, rng), markers, {}, rng);
  Detector detector(Families::load(std::vector<std::string>{"apriltag_36h11", "aruco_5x5_50"}).value());
  std::vector<Detection> found, again;
  detector.detect(grey, nullptr, &found);
  ASSERT_EQ(found.size(), 4);
  detector.detect(grey, nullptr, &again);
  const long before = allocations;
  detector.detect(grey, nullptr, &again);
  EXPECT_EQ(allocations - before, 0);
  detector.follow(grey, nullptr, found, &again);
  const long before_follow = allocations;
  detector.follow(grey, nullptr, found, &again);
  EXPECT_EQ(allocations - before_follow, 0);
  EXPECT_EQ(again.size(), 4);
}

}  // namespace
}  // namespace limn::tracker
