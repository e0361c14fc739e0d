// The stroke of a pen from known poses of its marker: where it lies, where it begins and ends.
#include "session/pen/pen_stroke.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "scene/lines/drape.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn::session {
namespace {

using Eigen::Vector3d;

constexpr double k_frame_s = 1 / 30.0;
const Vector3d k_p_tip_marker(0, 0.045, 0.015);
const Pose k_world_from_prototype(exp_rotation({0.3, -0.2, 0.5}), {0.1, 0.2, 0.4});

// A sheet z = 0.02 cos(x / 0.05), with a back 1 mm below it.
double height_at(double x) { return 0.02 * std::cos(x / 0.05); }
Vector3d on_sheet(double x, double y) { return {x, y, height_at(x)}; }
Vector3d normal_at(double x) { return Vector3d(0.4 * std::sin(x / 0.05), 0, 1).normalized(); }

scene::Scene scene_of_a_sheet() {
  scene::Mesh mesh;
  constexpr std::uint32_t k_count = 300;
  for (const double below : {0.0, 1e-3})
    for (std::uint32_t i = 0; i <= k_count; ++i)
      for (const double y : {-0.15, 0.15}) {
        const double x = 0.3 * i / k_count - 0.15;
        mesh.positions.push_back(Vector3d(x, y, height_at(x) - below).cast<float>());
        mesh.normals.emplace_back(0.0F, 0.0F, below > 0 ? -1.0F : 1.0F);
      }
  for (const std::uint32_t side : {0U, 1U})
    for (std::uint32_t i = 0; i < k_count; ++i) {
      const std::uint32_t a = side * 2 * (k_count + 1) + 2 * i;
      for (std::array<std::uint32_t, 3> t : {std::array{a, a + 2, a + 3}, std::array{a, a + 3, a + 1}}) {
        if (side == 1) std::swap(t[1], t[2]);
        mesh.triangles.push_back(t);
      }
    }
  scene::Scene scene;
  scene.prototype.emplace();
  scene.drape = std::make_shared<const scene::Drape>(mesh);
  scene.pen = scene::Pen{MarkerName::parse("aruco_4x4_50:7").value(), 0.06, k_p_tip_marker};
  return scene;
}

// A pen whose tip is moved along a path; strokes are collected as a session does.
class Drawing {
 public:
  // The tip's true place in the prototype's frame; nullopt: the marker is not seen.
  void see(const std::optional<Vector3d>& p_tip, const Vector3d& noise = Vector3d::Zero()) {
    at_ = shifted(at_, k_frame_s);
    std::vector<Track> tracks(2);
    tracks[0].body = "prototype";
    tracks[0].world_from_body = k_world_from_prototype;
    tracks[1].body = scene::pen_body();
    if (p_tip) {
      // It faces away from the surface, upright.
      const Eigen::Quaterniond prototype_from_marker(Eigen::AngleAxisd(M_PI, Vector3d::UnitX()));
      seen_ = k_world_from_prototype *
              Pose(prototype_from_marker, *p_tip + noise - prototype_from_marker * k_p_tip_marker);
      seen_at_ = at_;
    }
    tracks[1].world_from_body = seen_;
    tracks[1].captured_at = seen_at_;
    tracks[1].tracking = p_tip ? TrackingState::measured : TrackingState::extrapolated;
    tracks[0].captured_at = tracks[0].at = tracks[1].at = at_;
    const PenStroke::Addition addition = pen_.note(scene_, tracks, at_);
    if (addition.begins) strokes.emplace_back();
    if (addition.points.empty()) return;
    ASSERT_FALSE(strokes.empty());
    strokes.back().insert(strokes.back().end(), addition.points.begin(), addition.points.end());
    added_at.push_back(seconds_of(at_));
  }
  void follow(const std::function<Vector3d(double)>& path, double seconds) {
    for (double t = 0; t <= seconds; t += k_frame_s) see(path(t));
  }
  bool is_on() const { return pen_.is_on(); }

  std::vector<std::vector<Vector3d>> strokes;
  std::vector<double> added_at;

 private:
  scene::Scene scene_ = scene_of_a_sheet();
  PenStroke pen_;
  Stamp at_, seen_at_;
  Pose seen_;
};

double distance(const std::vector<Vector3d>& line, const Vector3d& p) {
  double nearest = 1;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vector3d ab = line[i + 1] - line[i];
    nearest = std::min(
        nearest, (line[i] + std::clamp((p - line[i]).dot(ab) / ab.squaredNorm(), 0.0, 1.0) * ab - p).norm());
  }
  return nearest;
}

// A circle of 40 mm radius seen from z, at 96 mm/s.
Vector3d round_at(double t) {
  const double x = 0.04 * std::cos(2.4 * t), y = 0.04 * std::sin(2.4 * t);
  return on_sheet(x, y);
}

TEST(PenStroke, LiesWhereTheTipWas) {
  std::mt19937_64 rng = test::test_rng();
  std::normal_distribution<double> noise(0, 0.2e-3);  // of each coordinate of the tip
  Drawing drawing;
  std::vector<Vector3d> raw;
  for (double t = 0; t < 2.2; t += k_frame_s) {
    const Vector3d n(noise(rng), noise(rng), noise(rng)), p = round_at(t);
    drawing.see(p + 1.5e-3 * normal_at(p.x()), n);
    raw.push_back(p + n - n.dot(normal_at(p.x())) * normal_at(p.x()));
  }
  for (int i = 0; i < 4; ++i) drawing.see(round_at(2.2) + Vector3d(0, 0, 0.03));
  ASSERT_EQ(drawing.strokes.size(), 1U);
  std::vector<Vector3d> path;
  for (double t = 0; t < 2.2; t += 0.002) path.push_back(round_at(t));
  const auto rms_and_worst_mm = [&](const std::vector<Vector3d>& points) {
    double sum = 0, worst = 0;
    for (const Vector3d& p : points) {
      const double mm = 1e3 * distance(path, p);
      sum += mm * mm;
      worst = std::max(worst, mm);
    }
    return std::pair(std::sqrt(sum / static_cast<double>(points.size())), worst);
  };
  const auto [rms, worst] = rms_and_worst_mm(drawing.strokes[0]);
  const auto [raw_rms, raw_worst] = rms_and_worst_mm(raw);
  fmt::print("{} points: {:.3f} mm RMS, {:.3f} mm at most from the tip; measured {:.3f}, {:.3f} mm\n",
             drawing.strokes[0].size(), rms, worst, raw_rms, raw_worst);
  EXPECT_LT(worst, 0.5);
  EXPECT_LT(rms, 0.7 * raw_rms) << "it is smoothed";
  for (double t = 0.1; t < 2.1; t += 0.01)
    EXPECT_LT(1e3 * distance(drawing.strokes[0], round_at(t)), 0.5) << t;
  for (const Vector3d& p : drawing.strokes[0])
    EXPECT_NEAR(p.z(), height_at(p.x()), 0.05e-3) << "not the back";
}

TEST(PenStroke, IsDrawnWhileTheTipIsMoved) {
  Drawing drawing;
  std::size_t before = 0;
  for (double t = 0; t < 1; t += k_frame_s) {
    drawing.see(on_sheet(0.1 * t, 0));
    if (t < 0.2) continue;
    ASSERT_EQ(drawing.strokes.size(), 1U);
    EXPECT_GT(drawing.strokes[0].size(), before) << "each frame adds to it";
    before = drawing.strokes[0].size();
    EXPECT_LT(0.1 * t - drawing.strokes[0].back().x(), 0.1 * 0.085) << "at most 85 ms behind the tip";
  }
}

TEST(PenStroke, CornersStay) {
  Drawing drawing;
  drawing.follow([](double t) { return on_sheet(0.1 * t - 0.05, 0); }, 0.5);
  drawing.follow([](double t) { return on_sheet(0, 0.1 * t); }, 0.5);
  for (int i = 0; i < 4; ++i) drawing.see(Vector3d(0, 0.05, 0.1));
  ASSERT_EQ(drawing.strokes.size(), 1U);
  EXPECT_LT(1e3 * distance(drawing.strokes[0], on_sheet(0, 0)), 0.5);
}

TEST(PenStroke, NothingIsDrawnInTheAirNorByATouch) {
  Drawing drawing;
  drawing.follow([](double t) { return Vector3d(on_sheet(0.1 * t - 0.1, 0) + Vector3d(0, 0, 0.007)); }, 2);
  for (int i = 0; i < 60; ++i)  // a touch
    drawing.see(on_sheet(0.02, 0.01) + Vector3d(0, 0, 1e-3 * std::abs(i - 30)));
  for (int i = 0; i < 30; ++i) drawing.see(on_sheet(0.02, 0.01) + Vector3d(0.1 * i, 0.1, 0.3));
  EXPECT_TRUE(drawing.strokes.empty());
}

TEST(PenStroke, EndsWhereTheTipLeavesTheSurface) {
  Drawing drawing;
  // 60 mm on the surface; then, going on, away from it by half of its way.
  const auto path = [](double t) {
    const double x = 0.1 * t - 0.1;
    return Vector3d(on_sheet(x, 0.02) + std::max(0.0, x + 0.04) / 2 * Vector3d::UnitZ());
  };
  drawing.follow(path, 1.6);
  ASSERT_EQ(drawing.strokes.size(), 1U);
  double farthest = -1;
  for (const Vector3d& p : drawing.strokes[0]) farthest = std::max(farthest, p.x());
  EXPECT_GT(farthest, -0.04 + 2 * PenStroke::k_begins_m - 2e-3);
  EXPECT_LT(farthest, -0.04 + 2 * 1.2 * PenStroke::k_ends_m + 2e-3);  // the surface is inclined
  EXPECT_FALSE(drawing.is_on());
  // The tip hovers between both limits: the stroke neither begins, nor ends when it has begun.
  Drawing hovering;
  hovering.follow([](double t) { return Vector3d(on_sheet(0.02 * t, 0) + Vector3d(0, 0, 6.5e-3)); }, 0.5);
  EXPECT_FALSE(hovering.is_on());
  hovering.follow([](double t) { return on_sheet(0.05 * t, 0); }, 0.5);
  EXPECT_TRUE(hovering.is_on());
  hovering.follow([](double t) { return Vector3d(on_sheet(0.025 + 0.05 * t, 0) + Vector3d(0, 0, 6.5e-3)); },
                  0.5);
  EXPECT_TRUE(hovering.is_on());
  EXPECT_EQ(hovering.strokes.size(), 1U);
}

TEST(PenStroke, EndsWhenTheMarkerIsCoveredAndDoesNotJump) {
  Drawing drawing;
  drawing.follow([](double t) { return on_sheet(0.1 * t - 0.1, 0); }, 0.5);
  for (int i = 0; i < 3; ++i) drawing.see(std::nullopt);  // for a tenth of a second
  drawing.follow([](double t) { return on_sheet(0.1 * t - 0.04, 0); }, 0.3);
  EXPECT_EQ(drawing.strokes.size(), 1U);
  for (int i = 0; i < 9; ++i) drawing.see(std::nullopt);
  EXPECT_FALSE(drawing.is_on());
  const std::size_t count = drawing.strokes[0].size();
  drawing.follow([](double t) { return on_sheet(0.1 * t, 0.05); }, 0.3);
  ASSERT_EQ(drawing.strokes.size(), 2U);
  EXPECT_EQ(drawing.strokes[0].size(), count);
  for (const Vector3d& p : drawing.strokes[1]) EXPECT_NEAR(p.y(), 0.05, 1e-3);
  // A wrong pose elsewhere on the surface ends the stroke.
  drawing.see(on_sheet(-0.1, -0.1));
  drawing.follow([](double t) { return on_sheet(0.03 + 0.1 * t, 0.05); }, 0.5);
  for (const auto& stroke : drawing.strokes)
    for (std::size_t i = 1; i < stroke.size(); ++i) EXPECT_LT((stroke[i] - stroke[i - 1]).norm(), 0.03);
}

TEST(PenStroke, AHandThatRestsAddsNothing) {
  std::mt19937_64 rng = test::test_rng();
  std::normal_distribution<double> noise(0, 0.15e-3);
  Drawing drawing;
  drawing.follow([](double t) { return on_sheet(0.1 * t, 0); }, 0.5);
  for (int i = 0; i < 15; ++i) drawing.see(on_sheet(0.05, 0), {noise(rng), noise(rng), noise(rng)});
  const std::size_t count = drawing.strokes.at(0).size();
  for (int i = 0; i < 300; ++i) drawing.see(on_sheet(0.05, 0), {noise(rng), noise(rng), noise(rng)});
  EXPECT_LE(drawing.strokes[0].size(), count + 10);
}

}  // namespace
}  // namespace limn::session
