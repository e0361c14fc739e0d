// Gaps in the comparison of a flat sheet, whose distances rise along x.
#include "session/deviation/small_gaps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace limn::session {
namespace {

constexpr int k_side = 40;
constexpr double k_spacing_m = 1e-3, k_slope = 0.01;

std::size_t point(int x, int y) { return static_cast<std::size_t>(y * k_side + x); }

double height_m(int x) { return k_slope * k_spacing_m * x; }

calib::Deviation sheet() {
  calib::Deviation out;
  out.cad.spacing_m = k_spacing_m;
  for (int y = 0; y < k_side; ++y)
    for (int x = 0; x < k_side; ++x) {
      out.cad.surface.positions.emplace_back(
          Eigen::Vector3d(k_spacing_m * x, k_spacing_m * y, 0).cast<float>());
      out.cad.surface.normals.emplace_back(0, 0, 1);
      out.distances_m.push_back(static_cast<float>(height_m(x)));
      out.stddevs_m.push_back(2e-5f);
      out.states.push_back(calib::DeviationState::measured);
      if (x == 0 || y == 0) continue;
      const auto at = [&](int dx, int dy) { return static_cast<std::uint32_t>(point(x - dx, y - dy)); };
      out.cad.surface.triangles.push_back({at(1, 1), at(0, 1), at(0, 0)});
      out.cad.surface.triangles.push_back({at(1, 1), at(0, 0), at(1, 0)});
    }
  return out;
}

void make_gap(int x, int y, int size, calib::DeviationState state, calib::Deviation* comparison) {
  for (int j = y; j < y + size; ++j)
    for (int i = x; i < x + size; ++i) {
      comparison->states[point(i, j)] = state;
      comparison->distances_m[point(i, j)] = std::numeric_limits<float>::quiet_NaN();
      comparison->stddevs_m[point(i, j)] = std::numeric_limits<float>::quiet_NaN();
    }
}

TEST(SmallGaps, AreBridgedSmoothly) {
  calib::Deviation comparison = sheet();
  make_gap(10, 12, 5, calib::DeviationState::not_measured, &comparison);
  comparison.stddevs_m[point(9, 12)] = 3e-5f;
  comparison.states[point(12, 17)] = calib::DeviationState::uncertain;
  comparison.distances_m[point(12, 17)] = 4e-4f;
  const calib::Deviation bridged = with_small_gaps_bridged(comparison);
  for (int y = 12; y < 17; ++y)
    for (int x = 10; x < 15; ++x) {
      ASSERT_TRUE(bridged.has(point(x, y)));
      EXPECT_NEAR(bridged.distances_m[point(x, y)], height_m(x), 2e-6);
      EXPECT_EQ(bridged.stddevs_m[point(x, y)], 3e-5f) << "the largest around it";
    }
}

TEST(SmallGaps, StayWhereAHandWas) {
  calib::Deviation comparison = sheet();
  make_gap(10, 12, 5, calib::DeviationState::beyond_reach, &comparison);
  make_gap(20, 20, 10, calib::DeviationState::not_measured, &comparison);
  const calib::Deviation bridged = with_small_gaps_bridged(comparison);
  EXPECT_FALSE(bridged.has(point(12, 14)));
  EXPECT_FALSE(bridged.has(point(20, 20))) << "too large to know what is there";
}

TEST(SmallGaps, StayAtAStep) {
  calib::Deviation comparison = sheet();
  for (int y = 0; y < k_side; ++y)
    for (int x = 12; x < k_side; ++x) comparison.distances_m[point(x, y)] += 1e-3f;
  make_gap(10, 12, 5, calib::DeviationState::not_measured, &comparison);
  EXPECT_FALSE(with_small_gaps_bridged(comparison).has(point(12, 14)));
}

}  // namespace
}  // namespace limn::session
