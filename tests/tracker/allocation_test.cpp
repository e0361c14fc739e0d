// A frame allocates no memory once the detector's buffers have grown to its size.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <opencv2/imgproc.hpp>

#include "tests/support/matchers.h"
#include "tests/tracker/marker_images.h"
#include "tracker/detector.h"

namespace {
long allocations = 0;
}

// Not inlined: with only one of a pair inlined, the compiler would report a mismatch of new and free.
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
  const cv::Mat grey = test::image_of(lens, test::clutter(640, 480, rng), markers, {}, rng);
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

// Images with fitted patterns (one with motion), lines between shadows, and covered codes.
TEST(Allocation, StopsInHardImagesToo) {
  auto rng = test::test_rng();
  const Lens lens =
      Lens::create("LENSMODEL_OPENCV8", {600, 600, 319.5, 239.5, -0.2, 0.05, 0, 0, 0, 0, 0, 0}).value();
  std::vector<test::PlacedMarker> markers;
  for (int i = 0; i < 4; ++i)
    markers.push_back(test::placed(lens, {"apriltag_36h11", std::to_string(i)}, {100.0 + 140 * i, 240}, 90,
                                   0.3 * i, i == 3 ? 1.35 : 0.4, 0.7 * i));
  const auto expect_none = [&](const cv::Mat& grey, std::size_t at_least) {
    Detector detector(Families::load(std::vector<std::string>{"apriltag_36h11"}).value());
    std::vector<Detection> found;
    for (int i = 0; i < 2; ++i) detector.detect(grey, &lens, &found);
    EXPECT_GE(found.size(), at_least);
    const long before = allocations;
    detector.detect(grey, &lens, &found);
    EXPECT_EQ(allocations - before, 0);
  };
  const cv::Mat clutter = test::clutter(640, 480, rng);
  {
    SCOPED_TRACE("blurred");
    expect_none(test::image_of(lens, clutter, markers, {.blur_px = 2.5, .noise_levels = 2}, rng), 3);
  }
  cv::Mat light = test::light_of(lens, clutter, markers, {}, rng);
  {
    SCOPED_TRACE("moved");
    cv::Mat moved;
    cv::blur(light, moved, {11, 1});
    expect_none(test::noisy_grey(moved, 2, rng), 3);
  }
  {
    SCOPED_TRACE("slatted shadow");
    for (int x = 0; x < light.cols; ++x)
      if (x % 34 < 17) light.col(x) *= 0.25;
    expect_none(test::noisy_grey(light, 2, rng), 2);
  }
}

}  // namespace
}  // namespace limn::tracker
