#pragma once

#include <random>
#include <string>
#include <vector>

#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/marker_images.h"
#include "tracker/detector.h"

/// Markers in front of cameras of 640x480, for the detector's tests.
namespace limn::tracker {

using namespace test::literals;
using test::PlacedMarker;
using test::uniform;

inline Families families(const std::vector<std::string>& names) { return Families::load(names).value(); }

inline Lens pinhole_vga() { return Lens::pinhole(600, 600, 319.5, 239.5); }
inline Lens bent_vga() {
  return Lens::create("LENSMODEL_OPENCV8", {500, 500, 319.5, 239.5, -0.25, 0.08, 1e-3, -1e-3, 0, 0, 0, 0})
      .value();
}

/// Six markers in clutter.
inline cv::Mat scattered_markers(int moved_px, std::mt19937_64& rng) {
  std::vector<PlacedMarker> markers;
  for (int i = 0; i < 6; ++i)
    markers.push_back(test::placed(pinhole_vga(), {"apriltag_36h11", std::to_string(i)},
                                   {120.0 + 190 * (i % 3) + moved_px, 130.0 + 210 * (i / 3)}, 60 + 8 * i,
                                   0.4 * i, 0.1 * i, i));
  return test::image_of(pinhole_vga(), test::clutter(640, 480, rng), markers, {.noise_levels = 2}, rng);
}

inline void expect_same(const std::vector<Detection>& a, const std::vector<Detection>& b, double within_px) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].marker.id, b[i].marker.id);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_TRUE(test::near(a[i].corners_px[k], b[i].corners_px[k], within_px));
  }
}

}  // namespace limn::tracker
