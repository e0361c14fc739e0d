#include "calib/surface/deviation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "calib/report/deviation_report.h"
#include "calib/surface/deviation_scale.h"
#include "tests/calib/scanned_panel.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;
using namespace test;
using namespace test::literals;

const Pose k_world_from_panel(exp_rotation({0.4, -0.7, 0.2}), {0.3, -0.2, 1.1});
const Pose k_start(exp_rotation({0.02, -0.01, 0.03}) * k_world_from_panel.rotation,
                   k_world_from_panel.translation + Vector3d(3e-3, -4e-3, 2e-3));
const std::vector<Bump> k_bumps = {{-0.09, 0.05, 0.02, 0.3e-3}, {-0.02, -0.05, 0.025, 1e-3},
                                   {0.07, 0.04, 0.02, 3e-3},    {0.1, -0.05, 0.02, -0.5e-3},
                                   {-0.1, -0.04, 0.025, -2e-3}, {0.02, 0.03, 0.03, -3e-3}};

Result<Registration> registered(const scene::Mesh& cad,
                                const scene::ScanSurface& scan,
                                const Pose& start = k_start) {
  return refined_registration(cad, scene::MeshBvh(cad), scan, start, {.reach = 0.05, .free_stddev_m = 5e-3});
}

struct DeviationErrors {
  int count = 0;
  double rms_mm = 0, pull = 0;
  double right_sign = 0;  // share of the points where the truth exceeds 0.3 mm
};

DeviationErrors errors_of(const Deviation& deviation, const std::vector<Bump>& bumps) {
  DeviationErrors e;
  double large = 0;
  for (std::size_t i = 0; i < deviation.states.size(); ++i) {
    if (!deviation.has(i)) continue;
    const Eigen::Vector3f& p = deviation.cad.surface.positions[i];
    const double truth = height_of(bumps, p.x(), p.y()), found = deviation.distances_m[i];
    ++e.count;
    e.rms_mm += 1e6 * (found - truth) * (found - truth);
    e.pull += std::pow((found - truth) / static_cast<double>(deviation.stddevs_m[i]), 2);
    if (std::abs(truth) <= 0.3e-3) continue;
    ++large;
    e.right_sign += found * truth > 0;
  }
  e.rms_mm = std::sqrt(e.rms_mm / e.count);
  e.pull = std::sqrt(e.pull / e.count);
  e.right_sign /= std::max(1.0, large);
  return e;
}

TEST(Deviation, FindsBumpsAndDentsAndHowSureTheyAre) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 100, 70);
  const scene::ScanSurface scan =
      scan_of_panel(shaped, k_bumps, {.world_from_panel = k_world_from_panel}, rng);
  const auto pose = registered(cad, scan);
  ASSERT_TRUE(pose.ok()) << pose.message();
  const auto found = deviation(cad, scan, *pose);
  ASSERT_TRUE(found.ok()) << found.message();
  const DeviationErrors e = errors_of(*found, k_bumps);
  EXPECT_GT(e.count, 20000);
  EXPECT_LT(e.rms_mm, 0.06);
  EXPECT_GT(e.right_sign, 0.99);
  EXPECT_NEAR(e.pull, 1, 0.2);
  EXPECT_NEAR(found->noise_factor, 1, 0.1);
  const auto peaks = extremes(*found);
  ASSERT_EQ(peaks.size(), 4U) << "of six, one is as low as the tolerance, and one lower";
  EXPECT_NEAR(std::abs(peaks[0].distance_m), 3e-3, 0.2_mm);
  EXPECT_NEAR(peaks[0].distance_m, -peaks[1].distance_m, 0.3_mm) << "one is a bump, the other a dent";
  EXPECT_NEAR(peaks[2].distance_m, -2e-3, 0.2_mm);
  EXPECT_NEAR(peaks[3].distance_m, 1e-3, 0.2_mm);
  EXPECT_LT((peaks[3].p_prototype.head<2>() - Eigen::Vector2d(-0.02, -0.05)).norm(), 6_mm);
}

// Large deviations over a quarter of the panel.
TEST(Deviation, LargeDeviationsDoNotPullTheAlignment) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 100, 70);
  const std::vector<Bump> bumps = {{-0.08, 0.0, 0.07, 3e-3}, {0.1, 0.05, 0.03, -3e-3}};
  DeviationErrors sum;
  constexpr int k_draws = 4;
  for (int draw = 0; draw < k_draws; ++draw) {
    const scene::ScanSurface scan =
        scan_of_panel(shaped, bumps, {.world_from_panel = k_world_from_panel}, rng);
    const auto pose = registered(cad, scan);
    ASSERT_TRUE(pose.ok()) << pose.message();
    const auto found = deviation(cad, scan, *pose);
    ASSERT_TRUE(found.ok()) << found.message();
    const DeviationErrors e = errors_of(*found, bumps);
    EXPECT_LT(e.rms_mm, 0.08);
    EXPECT_GT(e.right_sign, 0.99);
    sum.pull += e.pull / k_draws;
  }
  EXPECT_NEAR(sum.pull, 1, 0.2);
}

// A finger on the panel and the hand behind it, 15 mm above.
TEST(Deviation, InventsNothingWhereAHandWas) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 100, 70);
  constexpr double k_finger = 8e-3, k_finger_y = 0.01;
  const auto is_hand = [](double x, double y) { return std::hypot(x - 0.1, y) < 0.04; };
  const auto is_finger = [](double x, double y) {
    return x > -0.05 && x < 0.1 && std::abs(y - k_finger_y) < k_finger;
  };
  const auto hidden_by = [&](const Vector3d& p) -> Vector3d {
    if (is_hand(p.x(), p.y())) return {p.x(), p.y(), p.z() + 0.015};
    if (!is_finger(p.x(), p.y())) return p;
    const double across = p.y() - k_finger_y;
    return {p.x(), p.y(), p.z() + k_finger + std::sqrt(k_finger * k_finger - across * across)};
  };
  const scene::ScanSurface scan =
      scan_of_panel(shaped, k_bumps, {.world_from_panel = k_world_from_panel, .hidden_by = hidden_by}, rng);
  const auto pose = registered(cad, scan);
  ASSERT_TRUE(pose.ok()) << pose.message();
  const auto found = deviation(cad, scan, *pose);
  ASSERT_TRUE(found.ok()) << found.message();
  int hidden = 0, beyond = 0;
  for (std::size_t i = 0; i < found->states.size(); ++i) {
    const Eigen::Vector3f& p = found->cad.surface.positions[i];
    if (!is_hand(p.x(), p.y()) && !is_finger(p.x(), p.y())) continue;
    ++hidden;
    beyond += found->states[i] == DeviationState::beyond_reach;
    EXPECT_FALSE(found->has(i)) << p.transpose() << ": " << found->distances_m[i];
    EXPECT_TRUE(std::isnan(found->distances_m[i]));
  }
  EXPECT_GT(hidden, 3000);
  EXPECT_GT(beyond, 300);
  const DeviationErrors e = errors_of(*found, k_bumps);
  EXPECT_GT(e.count, 15000);
  EXPECT_LT(e.rms_mm, 0.07);
}

// A plane holds neither slides in it nor the turn about its normal: where the deviation changes along it, it
// is not known where; elsewhere it is.
TEST(Deviation, IsUncertainWhereAPlanarPanelMaySlide) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(flat, 100, 70);
  const std::vector<Bump> bumps = {{0, 0, 0.02, 3e-3}};
  const scene::ScanSurface scan = scan_of_panel(flat, bumps, {.world_from_panel = k_world_from_panel}, rng);
  const auto pose = registered(
      cad, scan,
      Pose(k_world_from_panel.rotation,
           k_world_from_panel.translation + k_world_from_panel.rotation * Vector3d(2e-3, 1e-3, 1e-3)));
  ASSERT_TRUE(pose.ok()) << pose.message();
  EXPECT_EQ(pose->free_directions.size(), 3U);
  const auto found = deviation(cad, scan, *pose);
  ASSERT_TRUE(found.ok()) << found.message();
  int flank = 0, sure_flank = 0, plain = 0, sure_plain = 0;
  for (std::size_t i = 0; i < found->states.size(); ++i) {
    if (!found->has(i)) continue;
    const Eigen::Vector3f& p = found->cad.surface.positions[i];
    const float r = p.head<2>().norm();
    const bool is_sure = found->states[i] == DeviationState::measured;
    if (r > 0.008f && r < 0.014f) ++flank, sure_flank += is_sure;
    if (r > 0.04f) ++plain, sure_plain += is_sure;
  }
  EXPECT_GT(flank, 100);
  EXPECT_LT(sure_flank, 0.05 * flank);
  EXPECT_GT(sure_plain, 0.95 * plain);
  const auto warnings = deviation_warnings(*found, summary_of(*found), *pose);
  expect_contains(warnings.at(0), "slide along");
  expect_contains(warnings.at(0), "hatched");
  EXPECT_NEAR(errors_of(*found, bumps).pull, 1, 0.3);
}

TEST(Deviation, KnowsTheNoiseBetterThanTheScan) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 100, 70);
  for (const double stated : {0.04e-3, 0.0}) {
    const scene::ScanSurface scan = scan_of_panel(
        shaped, k_bumps,
        {.stddev_m = 0.08e-3, .stated_stddev_m = stated, .world_from_panel = k_world_from_panel}, rng);
    const auto pose = registered(cad, scan);
    ASSERT_TRUE(pose.ok()) << pose.message();
    const auto found = deviation(cad, scan, *pose);
    ASSERT_TRUE(found.ok()) << found.message();
    EXPECT_NEAR(errors_of(*found, k_bumps).pull, 1, 0.2);
    EXPECT_EQ(found->noise_was_stated, stated > 0);
    const auto warnings = deviation_warnings(*found, summary_of(*found), *pose);
    ASSERT_FALSE(warnings.empty());
    expect_contains(warnings.back(), stated > 0 ? "times as much" : "states no standard deviations");
  }
}

// Some programs export zeros, or nothing that is a number.
TEST(Deviation, EstimatesTheNoiseWhereTheStatedOneCannotBe) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 40, 28);
  const scene::ScanSurface scan = scan_of_panel(shaped, {}, {.spacing_m = 2e-3}, rng);
  for (const float stated : {0.f, -1.f, std::numeric_limits<float>::quiet_NaN()}) {
    scene::ScanSurface odd = scan;
    for (std::size_t i = 0; i < odd.stddevs.size(); i += 7) odd.stddevs[i] = stated;
    const auto found = deviation(cad, odd, Registration());
    ASSERT_TRUE(found.ok()) << found.message();
    EXPECT_FALSE(found->noise_was_stated);
    EXPECT_GT(errors_of(*found, {}).count, 3000);
    for (std::size_t i = 0; i < found->states.size(); ++i) {
      const float stddev = found->stddevs_m[i];
      EXPECT_TRUE(!found->has(i) || (stddev > 1e-6f && stddev < 1e-3f)) << i << ": " << stddev;
    }
  }
}

TEST(Deviation, TellsOfTrianglesThatAreInsideOut) {
  auto rng = test_rng();
  const scene::Mesh plain = panel_mesh(shaped, 40, 28);
  const scene::ScanSurface scan = scan_of_panel(shaped, {}, {.spacing_m = 2e-3}, rng);
  scene::Mesh cad = plain, sheet = plain;
  for (std::size_t i = 0; i < cad.triangles.size(); ++i) {
    if (plain.positions[plain.triangles[i][0]].x() < 0.05f) continue;
    std::swap(cad.triangles[i][0], cad.triangles[i][1]);
  }
  for (std::size_t i = 0; i < cad.positions.size(); ++i)
    if (cad.positions[i].x() > 0.05f) cad.normals[i] *= -1;
  // The back of a sheet of 2 mm is not measured, and no reason to worry.
  const auto first = static_cast<std::uint32_t>(plain.positions.size());
  for (std::size_t i = 0; i < plain.positions.size(); ++i) {
    sheet.positions.push_back(plain.positions[i] - 2e-3f * plain.normals[i]);
    sheet.normals.push_back(-plain.normals[i]);
  }
  for (const auto& [a, b, c] : plain.triangles) sheet.triangles.push_back({first + b, first + a, first + c});
  const auto found = deviation(cad, scan, Registration()), back = deviation(sheet, scan, Registration());
  ASSERT_TRUE(found.ok() && back.ok());
  EXPECT_NEAR(found->facing_away_m2, 0.1 * k_panel_height, 0.006);
  expect_contains(deviation_warnings(*found, summary_of(*found), {}).at(0), "inside out");
  EXPECT_LT(back->facing_away_m2, 1e-5);
  EXPECT_TRUE(deviation_warnings(*back, summary_of(*back), {}).empty());
}

// Each triangle with corners of its own, as a CAD's edges and seams have them.
scene::Mesh apart(const scene::Mesh& mesh) {
  scene::Mesh out = mesh;
  out.positions.clear();
  out.normals.clear();
  for (auto& triangle : out.triangles)
    for (std::uint32_t& corner : triangle) {
      out.positions.push_back(mesh.positions[corner]);
      out.normals.push_back(mesh.normals[corner]);
      corner = static_cast<std::uint32_t>(out.positions.size() - 1);
    }
  return out;
}

TEST(Deviation, ABumpIsOneExtremeWhereTheCadHasSeams) {
  auto rng = test_rng();
  const scene::Mesh cad = apart(panel_mesh(shaped, 40, 28));
  const auto found =
      deviation(cad, scan_of_panel(shaped, {{0, 0, 0.04, 3e-3}}, {.spacing_m = 2e-3}, rng), Registration());
  ASSERT_TRUE(found.ok()) << found.message();
  EXPECT_EQ(extremes(*found).size(), 1U);
}

// Points that are denser than the scan's say nothing of its noise to each other.
TEST(Deviation, DensePointsDoNotHideTheNoise) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 50, 35);
  const scene::ScanSurface scan = scan_of_panel(shaped, {}, {.spacing_m = 4e-3, .stated_stddev_m = 0}, rng);
  double stddev_m[2] = {};
  for (const bool is_dense : {false, true}) {
    const auto found = deviation(cad, scan, Registration(), {.spacing_m = is_dense ? 1.6e-3 : 0});
    ASSERT_TRUE(found.ok()) << found.message();
    stddev_m[is_dense ? 1 : 0] = summary_of(*found).median_stddev_m;
  }
  EXPECT_NEAR(stddev_m[1] / stddev_m[0], 1, 0.25);
}

TEST(Deviation, SaysWhatItNeeds) {
  auto rng = test_rng();
  const scene::Mesh cad = panel_mesh(shaped, 20, 14);
  scene::ScanSurface scan = scan_of_panel(shaped, {}, {.spacing_m = 4e-3}, rng);
  Registration away;
  away.world_from_prototype.translation = {0, 0, 1};
  expect_contains(deviation(cad, scan, away).message(), "found none. Check the pose, the units");
  scan.triangles.clear();
  expect_contains(deviation(cad, scan, Registration()).message(), "points alone");
}

// Ten thousand of them compare like a hundred thousand.
TEST(SurfaceSamples, CoverTheMeshAndDependOnItsAreaOnly) {
  const double area = area_of(panel_mesh(shaped, 400, 300));
  for (const int columns : {4, 60, 400}) {
    const scene::Mesh mesh = panel_mesh(shaped, columns, 3 * columns / 4);
    constexpr std::size_t k_most = 20'000;
    const SurfaceSamples samples = surface_samples(mesh, 4e-3, k_most);
    EXPECT_LE(samples.surface.positions.size(), k_most);
    EXPECT_GT(samples.surface.positions.size(), 3'000U);
    double sum = 0;
    for (const float share : samples.areas_m2) sum += static_cast<double>(share);
    EXPECT_NEAR(sum, area, 0.05 * area);
    const scene::MeshBvh index(mesh);
    for (std::size_t i = 0; i < samples.surface.positions.size(); i += 97)
      EXPECT_TRUE(index.nearest(samples.surface.positions[i].cast<double>(), 1e-6)) << i;
    for (const auto& [a, b, c] : samples.surface.triangles) {
      const Eigen::Vector3f& p = samples.surface.positions[a];
      const Eigen::Vector3f n = (samples.surface.positions[b] - p).cross(samples.surface.positions[c] - p);
      EXPECT_GT(n.dot(samples.surface.normals[a]), 0) << p.transpose();
    }
    if (columns > 200) continue;
    for (const auto& [a, b, c] : samples.surface.triangles)
      EXPECT_LE((samples.surface.positions[a] - samples.surface.positions[b]).norm(),
                samples.spacing_m * 1.0001);
  }
}

// Triangles that meet at an edge are divided at the same points of it.
// A box whose normals are those of its corners, as programs export it for smooth shading.
TEST(SurfaceSamples, FaceAsTheFacesDoWhereTheMeshIsShadedSmoothly) {
  scene::Mesh box;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3f p(corner & 1 ? 0.1F : -0.1F, corner & 2 ? 0.1F : -0.1F, corner & 4 ? 0.1F : -0.1F);
    box.positions.push_back(p);
    box.normals.push_back(p.normalized());
  }
  box.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                   {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  const SurfaceSamples samples = surface_samples(box, 0.02, 100'000);
  for (std::size_t i = 0; i < samples.surface.positions.size(); ++i) {
    EXPECT_GT(samples.surface.normals[i].cwiseAbs().maxCoeff(), 0.999F);
    EXPECT_GT(samples.surface.normals[i].dot(samples.surface.positions[i]), 0.0999F);
  }
  EXPECT_GT(samples.surface.positions.size(), 600U);
}

TEST(SurfaceSamples, HaveNoCracks) {
  const SurfaceSamples samples = surface_samples(panel_mesh(flat, 3, 2), 7e-3, 100'000);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : samples.surface.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
  for (const auto& [edge, count] : edges) {
    const Eigen::Vector3f middle =
        (samples.surface.positions[edge.first] + samples.surface.positions[edge.second]) / 2;
    const bool is_border = std::abs(std::abs(middle.x()) - k_panel_width / 2) < 1e-6 ||
                           std::abs(std::abs(middle.y()) - k_panel_height / 2) < 1e-6;
    EXPECT_EQ(count, is_border ? 1 : 2) << middle.transpose();
  }
}

TEST(DeviationScale, StepsAtTheTolerance) {
  EXPECT_EQ(deviation_band(0.5e-3, 0.5e-3), 0);
  EXPECT_EQ(deviation_band(0.51e-3, 0.5e-3), 1);
  EXPECT_EQ(deviation_band(-1.1e-3, 0.5e-3), -2);
  EXPECT_EQ(deviation_band(-9e-3, 0.5e-3), -3);
  EXPECT_EQ(band_text(0, 0.5e-3), "-0.5 to 0.5 mm");
  EXPECT_EQ(band_text(2, 0.5e-3), "1 to 2 mm");
  EXPECT_EQ(band_text(-1, 0.5e-3), "-1 to -0.5 mm");
  EXPECT_EQ(band_text(-3, 0.5e-3), "below -2 mm");
}

}  // namespace
}  // namespace limn::calib
