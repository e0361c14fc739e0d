// A pen in the studio: its marker is seen by the camera, and the line on the door lies where its tip was.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>

#include "device/gl_context.h"
#include "session/session.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* k_pen = "apriltag_36h11:21";
constexpr double k_pen_mm = 60;
const Vector3d k_p_tip_marker(0, 0.050, 0.012);  // below its lower edge, behind its paper

// The height of the door's outer side over its frame's plane z = 0, from all triangles.
double height_at(const scene::Mesh& mesh, double x, double y) {
  double highest = -std::numeric_limits<double>::infinity();
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = mesh.positions[triangle[0]].cast<double>(),
                   b = mesh.positions[triangle[1]].cast<double>(),
                   c = mesh.positions[triangle[2]].cast<double>();
    Eigen::Matrix2d sides;
    sides << (b - a).head<2>(), (c - a).head<2>();
    if (std::abs(sides.determinant()) < 1e-14) continue;
    const Eigen::Vector2d uv = sides.inverse() * (Eigen::Vector2d(x, y) - a.head<2>());
    if (uv.minCoeff() < 0 || uv.sum() > 1) continue;
    highest = std::max(highest, a.z() + uv.x() * (b - a).z() + uv.y() * (c - a).z());
  }
  return highest;
}

// The studio with a pen, whose tip is put where a test says.
class Studio {
 public:
  Studio() {
    const fs::path folder = test::test_folder();
    copy_studio_to(folder);
    json world_file = read_json(folder / "world.json"), scene_file = read_json(folder / "door/scene.json");
    scene_file["pen"] = {
        {"marker", k_pen},
        {"size_mm", k_pen_mm},
        {"tip_mm", {1e3 * k_p_tip_marker.x(), 1e3 * k_p_tip_marker.y(), 1e3 * k_p_tip_marker.z()}}};
    world_file["loose_markers"] = {
        {{"name", k_pen},
         {"size_mm", k_pen_mm},
         {"world_from_marker", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0, 0, 3}}}}}};
    write_json(folder / "world.json", world_file);
    write_json(folder / "door/scene.json", scene_file);
    sim::World world = sim::load_world(folder / "world.json", tracker::marker_image).value();
    for (const sim::PlacedMarker& placed : world.markers)
      if (placed.marker.text() == k_pen) object_ = placed.object;
    setup_ = {world.rig, *world.scene, {}, {}};
    rig_.emplace(std::move(world),
                 sim::VirtualRigOptions{.grab_waits_for_light = false, .follows_changes = true});
    perception_.emplace(Perception::create(setup_.scene, setup_.rig).value());
    context_.emplace(device::GlContext::create().value());
    session_.emplace(Session::create(setup_, nullptr, nullptr, false).value());
  }

  const scene::Mesh& door() const { return setup_.scene.prototype->mesh; }
  Vector3d on_door(double x, double y) const { return {x, y, height_at(door(), x, y)}; }

  // A frame of the camera with the tip there (prototype's frame), and with `is_shown` the projectors' images.
  void step(const Vector3d& p_tip, bool is_shown = false) {
    // Upright and facing away from the door.
    const Eigen::Quaterniond prototype_from_marker(0, 1, 0, 0);
    const Pose prototype_from_pen(prototype_from_marker, p_tip - prototype_from_marker * k_p_tip_marker);
    rig_->move(object_, rig_->world().world_from_prototype * prototype_from_pen);
    const int camera = 0;
    session_->update_percepts(perception_->watch(rig_->expose(std::span(&camera, 1))), ++moments_);
    if (is_shown) session_->compose(session_->predict({rig_->now(), shifted(rig_->now(), 0.04)}));
  }
  const scene::ShowState& state() const { return session_->show_state(); }
  const std::vector<scene::DrawnLine>& lit() const { return session_->composed().posed.drawn; }

 private:
  SessionSetup setup_;
  std::string object_;
  std::optional<sim::VirtualRig> rig_;
  std::optional<Perception> perception_;
  std::optional<device::GlContext> context_;
  std::optional<Session> session_;
  std::size_t moments_ = 0;
};

double distance(const std::vector<scene::SurfacePoint>& line, const Vector3d& p) {
  double nearest = 1;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vector3d ab = line[i + 1].p - line[i].p;
    const double along = std::clamp((p - line[i].p).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (line[i].p + along * ab - p).norm());
  }
  return nearest;
}

TEST(Pen, ItsLineLiesWithinHalfAMillimetreOfWhereItsTipWas) {
  Studio studio;
  constexpr int k_frames = 20;  // of half a circle, at 140 mm/s
  const auto arc = [&](double share) {
    const double turn = M_PI * std::clamp(share, 0.0, 1.0);
    return studio.on_door(0.06 + 0.03 * std::cos(turn), 0.02 + 0.03 * std::sin(turn));
  };
  const Vector3d in_the_air(0, 0, 0.03), at_the_door(0, 0, 0.001);
  for (int i = 0; i < 6; ++i) studio.step(arc(0) + in_the_air);
  EXPECT_TRUE(studio.state().drawn.empty());
  // It rests on the door for a moment before and after the stroke.
  int lit_after = -1;
  for (int i = -4; i <= k_frames + 3; ++i) {
    const bool is_drawing = i > 0 && lit_after < 0;
    studio.step(arc(static_cast<double>(i) / k_frames) + at_the_door, is_drawing);
    if (is_drawing && !studio.lit().empty()) lit_after = i;
  }
  EXPECT_GT(lit_after, 0);
  EXPECT_LE(lit_after, 6) << "it is seen while it is drawn";
  for (int i = 0; i < 4; ++i) studio.step(arc(1) + in_the_air);
  ASSERT_EQ(studio.state().drawn.size(), 1U) << "one line, once";
  const std::vector<scene::SurfacePoint> line = studio.state().drawn[0].curve.points;
  std::vector<scene::SurfacePoint> path;
  for (int i = 0; i <= 360; ++i) path.push_back({arc(i / 360.0), Vector3d::UnitZ()});
  std::vector<double> mm;
  for (const scene::SurfacePoint& point : path) mm.push_back(1e3 * distance(line, point.p));
  double worst_back = 0;
  for (const scene::SurfacePoint& point : line)
    worst_back = std::max(worst_back, 1e3 * distance(path, point.p));
  std::sort(mm.begin(), mm.end());
  std::printf(
      "pen: %zu points; the tip's way is %.2f mm (median), %.2f mm at most from the line, which is %.2f mm "
      "at "
      "most from it\n",
      line.size(), mm[mm.size() / 2], mm.back(), worst_back);
  EXPECT_LT(mm.back(), 0.5);
  EXPECT_LT(worst_back, 0.5);
}

}  // namespace
}  // namespace limn::session
