// Parts that a plane cuts open: caps without holes on random planes, judged by solid angles; and agreement
// with the ray tracer.
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "core/image_io.h"
#include "core/scale_resolution.h"
#include "scene/meshes/closed_pieces.h"
#include "sim/car_door.h"
#include "tests/projector/judged_image.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn::projector {
namespace {

using SectionTest = RendererTest;
using scene::CutPlane;

// How often the closed mesh winds around p: the solid angle of its triangles seen from there, divided by 4 pi
// (van Oosterom and Strackee 1983).
double windings(const Mesh& mesh, const Vector3d& p) {
  double sum = 0;
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = mesh.positions[triangle[0]].cast<double>() - p,
                   b = mesh.positions[triangle[1]].cast<double>() - p,
                   c = mesh.positions[triangle[2]].cast<double>() - p;
    const double na = a.norm(), nb = b.norm(), nc = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)), na * nb * nc + a.dot(b) * nc + b.dot(c) * na + c.dot(a) * nb);
  }
  return sum / (4 * std::numbers::pi);
}

// Where a plane crosses a closed mesh: directed sides of outlines on the plane, whose winding number is the
// mesh's. It decides in a hundredth of the time of solid angles, which judge where a picture disagrees.
// A corner on the plane counts as above it everywhere, so that the outlines close.
class CrossSection {
 public:
  CrossSection(const Mesh& mesh, const CutPlane& plane)
      : d_x_(plane.normal.unitOrthogonal()), d_y_(plane.normal.cross(d_x_)) {
    for (const auto& triangle : mesh.triangles) {
      std::array<Vector3d, 3> p;
      std::array<double, 3> height;
      for (std::size_t i = 0; i < 3; ++i) {
        p[i] = mesh.positions[triangle[i]].cast<double>();
        height[i] = height_over(plane, p[i]);
      }
      Side side;
      int crossings = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t next = (i + 1) % 3;
        if ((height[i] >= 0) == (height[next] >= 0)) continue;
        const std::size_t above = height[i] >= 0 ? i : next, below = height[i] >= 0 ? next : i;
        const Vector3d at =
            p[above] + height[above] / (height[above] - height[below]) * (p[below] - p[above]);
        (above == i ? side.from : side.to) = Eigen::Vector2d(d_x_.dot(at), d_y_.dot(at));
        ++crossings;
      }
      if (crossings == 2) sides_.push_back(side);
    }
  }

  // Whether the outlines wind around a point of the plane.
  bool is_inside(const Vector3d& p) const {
    const Eigen::Vector2d at(d_x_.dot(p), d_y_.dot(p));
    int windings = 0;
    for (const Side& side : sides_) {
      if ((side.from.y() > at.y()) == (side.to.y() > at.y())) continue;
      const double share = (at.y() - side.from.y()) / (side.to.y() - side.from.y());
      if (side.from.x() + share * (side.to.x() - side.from.x()) > at.x())
        windings += side.to.y() > side.from.y() ? 1 : -1;
    }
    return windings != 0;
  }

 private:
  struct Side {
    Eigen::Vector2d from = {0, 0}, to = {0, 0};
  };
  Vector3d d_x_, d_y_;
  std::vector<Side> sides_;
};

Eigen::AlignedBox3d box_of(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const auto& p : mesh.positions) box.extend(p.cast<double>());
  return box;
}

// A plane through the mesh; every third one passes exactly through a vertex, and every ninth is also parallel
// to two axes.
CutPlane random_plane(const Mesh& mesh, int index, std::mt19937_64& rng) {
  Vector3d normal(test::uniform(rng, -1, 1), test::uniform(rng, -1, 1), test::uniform(rng, -1, 1));
  if (index % 9 == 0) normal = Vector3d::Unit(index / 9 % 3) * (index % 2 == 0 ? 1 : -1);
  normal.normalize();
  if (index % 3 == 0) {
    const std::size_t vertex = rng() % mesh.positions.size();
    return {normal, normal.dot(mesh.positions[vertex].cast<double>())};
  }
  double low = 1e9, high = -1e9;
  for (const auto& p : mesh.positions) {
    low = std::min(low, normal.dot(p.cast<double>()));
    high = std::max(high, normal.dot(p.cast<double>()));
  }
  return {normal, test::uniform(rng, low, high)};
}

// A viewer who looks at the plane from the side that is removed, at a slant of at most 40 degrees.
Imager viewer_of_plane(const Mesh& mesh, const CutPlane& plane, int width, int height, std::mt19937_64& rng) {
  const Eigen::AlignedBox3d box = box_of(mesh);
  const double reach = 0.5 * box.diagonal().norm();
  const Vector3d p_middle = box.center() - height_over(plane, box.center()) * plane.normal;
  const Vector3d aside = plane.normal.unitOrthogonal(), beside = plane.normal.cross(aside);
  const double slant = test::uniform(rng, 0, 0.7), turn = test::uniform(rng, 0, 6.28);
  const Vector3d d =
      std::cos(slant) * plane.normal + std::sin(slant) * (std::cos(turn) * aside + std::sin(turn) * beside);
  return viewer_imager(looking_at(p_middle + 4 * reach * d, p_middle, aside).inverse(), width, height, 30);
}

// Where the ray of a pixel meets the plane.
std::optional<Vector3d> on_plane(const Imager& viewer, const CutPlane& plane, double x, double y) {
  const Vector3d d_viewer((x - viewer.lens.values[2]) / viewer.lens.fx(),
                          (y - viewer.lens.values[3]) / viewer.lens.values[1], 1);
  const Pose world_from_viewer = viewer.imager_from_world.inverse();
  const Vector3d d = world_from_viewer.rotation * d_viewer;
  const double t = -height_over(plane, world_from_viewer.translation) / plane.normal.dot(d);
  if (!(t > 0)) return std::nullopt;
  return world_from_viewer.translation + t * d;
}

// Whether what lies within `px` pixels of a pixel on the plane, and just below and above the plane there, is
// all inside the mesh (1), all outside (-1), or both (0). On a face in the plane neither answer is wrong.
int around(const Mesh& mesh, const Imager& viewer, const CutPlane& plane, double x, double y, double px) {
  int inside = 0;
  for (int i = 0; i < 25; ++i) {
    const auto p = on_plane(viewer, plane, x + px * (i % 5 - 2) / 2, y + px * (i / 5 - 2) / 2);
    for (const double side : {-2 * scene::k_cut_margin_m, 2 * scene::k_cut_margin_m}) {
      const double w = p ? std::abs(windings(mesh, *p + side * plane.normal)) : 0;
      if (w > 0.1 && w < 0.9) return 0;  // on the surface
      inside += w > 0.5;
    }
  }
  return inside == 50 ? 1 : inside == 0 ? -1 : 0;
}

const Vector3d k_cap(1, 0, 1);  // magenta, which no part has

// A scene with one part, which the section cuts; the prototype is far away.
Scene cut_scene(Mesh mesh) {
  for (scene::Material& material : mesh.materials) {
    material = {};
    material.base_colour = {0, 0.5F, 0};
    material.unlit = true;
  }
  Scene scene = scene_of(sheet(0.01, 0.01, 50), {slot("part", scene::Mode::view, std::move(mesh))});
  scene.section = scene::Section{.marker = {"aruco_4x4_50", "9"},
                                 .size_m = 0.04,
                                 .slots = {"part"},
                                 .cuts_prototype = false,
                                 .cap_colour = k_cap};
  return scene;
}

std::vector<std::pair<std::string, Mesh>> closed_parts_of_the_demo() {
  std::vector<std::pair<std::string, Mesh>> out;
  const Scene door = sim::car_door_scene();
  for (const scene::Variant& variant : door.slots[0].variants) out.emplace_back(variant.name, variant.mesh);
  out.emplace_back("door", door.prototype->mesh);
  return out;
}

TEST_F(SectionTest, TheDemoPartsCloseAndItsStripIsASheet) {
  for (const auto& [name, mesh] : closed_parts_of_the_demo()) {
    const std::vector<bool> closed = scene::are_of_closed_pieces(mesh);
    EXPECT_EQ(std::count(closed.begin(), closed.end(), false), 0) << name;
  }
  const std::vector<bool> strip =
      scene::are_of_closed_pieces(sim::car_door_scene().slots[1].variants[0].mesh);
  EXPECT_EQ(std::count(strip.begin(), strip.end(), true), 0);
}

// A hole in a cap, or a cap where there is none, at a pixel: the middle of a closed region that the renderer
// shows otherwise.
struct Mistakes {
  int holes = 0, outside = 0, caps = 0, pixels = 0;
};

bool is_cap_colour(const cv::Vec3b& bgr) { return bgr[1] < 8 && bgr[0] > 150 && bgr[2] > 150; }

// Judges a picture at every `step`-th pixel, and at pixels that differ from their surroundings.
Mistakes judged(
    const cv::Mat& drawn, const Mesh& mesh, const Imager& viewer, const CutPlane& plane, int step) {
  Mistakes out;
  const CrossSection section(mesh, plane);
  cv::Mat1b caps(drawn.size()), smooth;
  for (int row = 0; row < drawn.rows; ++row)
    for (int column = 0; column < drawn.cols; ++column)
      caps(row, column) = is_cap_colour(drawn.at<cv::Vec3b>(row, column)) ? 255 : 0;
  cv::medianBlur(caps, smooth, 5);
  for (int row = 2; row < drawn.rows - 2; ++row)
    for (int column = 2; column < drawn.cols - 2; ++column) {
      const bool is_cap = caps(row, column) != 0, is_odd = is_cap != (smooth(row, column) != 0);
      if (!is_odd && (row % step != 0 || column % step != 0)) continue;
      const auto p = on_plane(viewer, plane, column, row);
      const bool wanted = p && section.is_inside(*p);
      ++out.pixels;
      out.caps += wanted;
      if (wanted == is_cap || around(mesh, viewer, plane, column, row, 1.5) != (is_cap ? -1 : 1)) continue;
      (is_cap ? out.outside : out.holes) += 1;
    }
  return out;
}

TEST_F(SectionTest, CapsHaveNoHolesOnRandomPlanes) {
  std::mt19937_64 rng(20261128);
  constexpr int k_planes = 14;  // of each part; the ray tracer gets a thousand
  int planes = 0;
  Mistakes all;
  for (const auto& [name, mesh] : closed_parts_of_the_demo()) {
    const Scene scene = cut_scene(mesh);
    Renderer drawing = renderer(scene, two_projectors());
    PosedScene posed = posed_at_origin(scene);
    const int count = name == "door" ? k_planes / 3 : k_planes;
    for (int i = 0; i < count; ++i) {
      posed.cut = random_plane(mesh, i, rng);
      const Imager viewer = viewer_of_plane(mesh, *posed.cut, 320, 240, rng);
      const cv::Mat drawn = drawing.view(viewer, posed, cv::Scalar::all(0));
      const Mistakes found = judged(drawn, mesh, viewer, *posed.cut, name == "door" ? 32 : 10);
      EXPECT_EQ(found.holes, 0) << name << ", plane " << i;
      EXPECT_EQ(found.outside, 0) << name << ", plane " << i;
      all.caps += found.caps;
      all.pixels += found.pixels;
      ++planes;
      if (!HasFailure()) continue;
      EXPECT_TRUE(write_png(test::test_folder() / "cap.png", drawn));
      return;
    }
  }
  std::printf("drawn: %d planes, %d pixels judged, %d of them on caps\n", planes, all.pixels, all.caps);
  EXPECT_GT(all.caps, 1000);
}

TEST_F(SectionTest, TheRayTracersCapsHaveNoHolesOnAThousandPlanes) {
  std::mt19937_64 rng(20261128);
  int planes = 0, caps = 0;
  for (const auto& [name, mesh] : closed_parts_of_the_demo()) {
    sim::World world;
    world.rig = two_projectors();
    world.scene = cut_scene(mesh);
    PosedScene posed = posed_at_origin(*world.scene);
    posed.world_from_prototype.reset();
    const int count = name == "door" ? 40 : 320;
    for (int i = 0; i < count; ++i, ++planes) {
      posed.cut = random_plane(mesh, i, rng);
      const CrossSection section(mesh, *posed.cut);
      const Imager viewer = viewer_of_plane(mesh, *posed.cut, 12, 9, rng);
      const sim::PartImage drawn = sim::ReferenceRenderer(world, posed, viewer).parts_image(viewer);
      for (int row = 0; row < drawn.cover.rows; ++row)
        for (int column = 0; column < drawn.cover.cols; ++column) {
          const cv::Vec3f& light = drawn.light.at<cv::Vec3f>(row, column);
          const bool is_cap = drawn.cover.at<float>(row, column) == 1 && light[1] == 0 && light[0] > 0;
          const bool is_none = light[0] == 0;
          if (!is_cap && !is_none) continue;  // a pixel on an edge
          const auto p = on_plane(viewer, *posed.cut, column, row);
          const bool wanted = p && section.is_inside(*p);
          caps += wanted;
          if (wanted == is_cap || around(mesh, viewer, *posed.cut, column, row, 0.2) != (is_cap ? -1 : 1))
            continue;
          ADD_FAILURE() << name << ", plane " << i << ": " << (is_cap ? "a cap outside" : "a hole");
          return;
        }
    }
  }
  std::printf("traced: %d planes, %d pixels on caps\n", planes, caps);
  EXPECT_EQ(planes, 1000);
  EXPECT_GT(caps, 2500);
}

// A closed box, its middle at the origin.
Mesh block(const Vector3d& size) {
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      const Vector3d n = side * Vector3d::Unit(axis), u = Vector3d::Unit((axis + 1) % 3), v = n.cross(u);
      for (const auto& [a, b] : {std::pair(-1.0, -1.0), {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
        mesh.positions.push_back((0.5 * (n + a * u + b * v).cwiseProduct(size)).cast<float>());
        mesh.normals.push_back(n.cast<float>());
      }
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first, first + 2, first + 3});
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  return mesh;
}

void add(const Mesh& other, const Vector3d& at, bool is_reversed, Mesh* mesh) {
  const auto first = static_cast<std::uint32_t>(mesh->positions.size());
  for (std::size_t i = 0; i < other.positions.size(); ++i) {
    mesh->positions.push_back(other.positions[i] + at.cast<float>());
    mesh->normals.push_back((is_reversed ? -1.0F : 1.0F) * other.normals[i]);
  }
  for (const auto& t : other.triangles)
    mesh->triangles.push_back(is_reversed
                                  ? std::array<std::uint32_t, 3>{first + t[0], first + t[2], first + t[1]}
                                  : std::array<std::uint32_t, 3>{first + t[0], first + t[1], first + t[2]});
  mesh->triangle_materials.assign(mesh->triangles.size(), 0);
}

// The colour in the middle of a view along z at p (x, y), 1 m in front of it.
cv::Vec3b seen_at(Renderer* drawing, const PosedScene& posed, const Vector3d& p) {
  const Vector3d p_eye(p.x() + 1e-4, p.y() + 2e-4, -1);
  const Imager viewer =
      viewer_imager(looking_at(p_eye, Vector3d(p.x(), p.y(), 0), k_up).inverse(), 65, 65, 3);
  return drawing->view(viewer, posed, cv::Scalar(0, 0, 90)).at<cv::Vec3b>(32, 32);
}

const CutPlane k_front{{0, 0, -1}, 0};  // removes z < 0, which faces the viewer of seen_at()

TEST_F(SectionTest, CavitiesStayOpenAndPiecesInsideOthersAreFilled) {
  Mesh mesh = block({0.2, 0.2, 0.1});
  add(block({0.04, 0.04, 0.04}), {-0.05, 0, 0}, true, &mesh);  // a cavity
  add(block({0.04, 0.04, 0.04}), {0.05, 0, 0}, false, &mesh);  // a piece inside
  const Scene scene = cut_scene(mesh);
  Renderer drawing = renderer(scene, two_projectors());
  PosedScene posed = posed_at_origin(scene);
  posed.cut = k_front;
  EXPECT_TRUE(is_cap_colour(seen_at(&drawing, posed, {0, 0.06, 0})));
  EXPECT_TRUE(is_cap_colour(seen_at(&drawing, posed, {0.05, 0, 0})));
  EXPECT_GT(seen_at(&drawing, posed, {-0.05, 0, 0})[1], 60);  // the cavity's bottom
  EXPECT_EQ(seen_at(&drawing, posed, {0.2, 0, 0}), cv::Vec3b(0, 0, 90));
  posed.cut = scene::flipped(k_front);  // seen from the kept side: whole
  EXPECT_GT(seen_at(&drawing, posed, {0, 0.06, 0})[1], 60);
  posed.cut = CutPlane{{0, 0, -1}, -0.2};  // it misses the part, which is all kept
  EXPECT_FALSE(is_cap_colour(seen_at(&drawing, posed, {0, 0.06, 0})));
}

TEST_F(SectionTest, APieceInsideOutHasACapToo) {
  Mesh mesh;
  mesh.materials.emplace_back();
  add(block({0.2, 0.2, 0.1}), {0, 0, 0}, true, &mesh);
  const Scene scene = cut_scene(mesh);
  Renderer drawing = renderer(scene, two_projectors());
  PosedScene posed = posed_at_origin(scene);
  posed.cut = k_front;
  EXPECT_TRUE(is_cap_colour(seen_at(&drawing, posed, {0, 0.06, 0})));
}

TEST_F(SectionTest, ASheetIsCutWithoutACap) {
  Mesh mesh = sheet(0.2, 0.2, 0.05);                       // parallel to the plane, kept
  add(sheet(0.2, 0.2, -0.05), {0.3, 0, 0}, false, &mesh);  // removed
  const Scene scene = cut_scene(mesh);
  Renderer drawing = renderer(scene, two_projectors());
  PosedScene posed = posed_at_origin(scene);
  posed.cut = k_front;
  EXPECT_GT(seen_at(&drawing, posed, {0, 0, 0})[1], 60);
  EXPECT_EQ(seen_at(&drawing, posed, {0.3, 0, 0}), cv::Vec3b(0, 0, 90));
}

TEST_F(SectionTest, ThePrototypeIsCutInViewsOnly) {
  Mesh mesh = block({0.3, 0.3, 0.2});
  Scene scene =
      scene_of(mesh, {slot("part", scene::Mode::view, coloured(block({0.02, 0.02, 0.02}), {0, 1, 0}))});
  scene.section =
      scene::Section{.marker = {"aruco_4x4_50", "9"}, .size_m = 0.04, .slots = {}, .cap_colour = k_cap};
  Renderer drawing = renderer(scene, two_projectors());
  PosedScene posed = posed_at_origin(scene);
  const Imager viewer = viewer_from({0, 0, -1.2});
  const cv::Mat light = drawing.projector_image(0, posed, viewer);
  const cv::Mat points = drawing.surface_points(0, posed);
  posed.cut = k_front;
  EXPECT_TRUE(is_cap_colour(seen_at(&drawing, posed, {0, 0.1, 0})));
  EXPECT_EQ(cv::norm(drawing.projector_image(0, posed, viewer), light, cv::NORM_INF), 0);
  cv::Mat points_now = drawing.surface_points(0, posed);
  EXPECT_EQ(cv::norm(cv::Mat(points_now != points_now), cv::Mat(points != points), cv::NORM_INF), 0);
  scene.section->cuts_prototype = false;
  Renderer whole = renderer(scene, two_projectors());
  EXPECT_FALSE(is_cap_colour(seen_at(&whole, posed, {0, 0.1, 0})));
}

// The demo's mirror, cut, in front of a panel.
JudgedRoom mirror_room(const Vector3d& cap_colour) {
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  Mesh mirror = sim::car_door_scene().slots[0].variants[2].mesh;
  Scene scene = scene_of(sheet(0.5, 0.36), {slot("mirror", scene::Mode::view, std::move(mirror))});
  scene.light = scene::RoomLight{
      k_up, {0.05, 0.08, 0.1}, {0.3, 0.28, 0.25}, {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  scene.section = scene::Section{
      .marker = {"aruco_4x4_50", "9"}, .size_m = 0.04, .slots = {"mirror"}, .cap_colour = cap_colour};
  JudgedRoom room = judged_room(std::move(rig), std::move(scene));
  // The door's z comes out of the panel, whose front faces -z.
  room.posed.parts[0].world_from_part = Pose(exp_rotation({std::numbers::pi, 0, 0}), {0, 0, -0.001});
  room.posed.cut = CutPlane{Vector3d(0.25, -0.3, -1).normalized(), 0.055};
  return room;
}

// Pixels within two pixels of where the judge's pictures of two cap colours begin or end to differ.
cv::Mat1b outline_of_caps(const cv::Mat& light, const cv::Mat& other) {
  cv::Mat1b caps(light.size()), grown, shrunk;
  for (int row = 0; row < light.rows; ++row)
    for (int column = 0; column < light.cols; ++column)
      caps(row, column) =
          cv::norm(light.at<cv::Vec3f>(row, column) - other.at<cv::Vec3f>(row, column)) > 0.01;
  const cv::Mat around = cv::Mat::ones(5, 5, CV_8U);
  cv::dilate(caps, grown, around);
  cv::erode(caps, shrunk, around);
  cv::Mat1b out;
  cv::subtract(grown, shrunk, out);
  return out;
}

// How far a picture is from the judge's where that covers whole pixels, without those of `but`, in levels:
// the mean of the largest differences of the channels, and the share of pixels over 4 levels. It contains the
// edges of lines, which the renderer draws with 8 samples.
struct Difference {
  double mean = 255, far_share = 1;
};

Difference difference(const cv::Mat& drawn,
                      const sim::PartImage& judged,
                      double gamma,
                      const cv::Mat1b& but) {
  int count = 0, far_off = 0;
  double sum = 0;
  for (int row = 0; row < drawn.rows; ++row)
    for (int column = 0; column < drawn.cols; ++column) {
      if (judged.cover.at<float>(row, column) < 1 || but(row, column) != 0) continue;
      double worst = 0;
      for (int c = 0; c < 3; ++c) {
        const double light = std::clamp<double>(judged.light.at<cv::Vec3f>(row, column)[c], 0, 1);
        const double wanted = 255 * (gamma > 0 ? std::pow(light, 1 / gamma) : srgb_from_linear(light));
        worst = std::max(worst, std::abs(drawn.at<cv::Vec3b>(row, column)[c] - wanted));
      }
      ++count;
      sum += worst;
      far_off += worst > 4;
    }
  if (count < 3000) return {};
  return {sum / count, 1.0 * far_off / count};
}

TEST_F(SectionTest, LightAndCompositesAreThoseOfTheRayTracer) {
  const JudgedRoom room = mirror_room({0.72, 0.62, 0.42}), other = mirror_room({0.1, 0.1, 0.9});
  Renderer drawing = renderer(room.scene, room.rig);
  const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer),
      other_judge(other.world, other.posed, other.viewer);
  const cv::Mat drawn = composite_over_black(&drawing, room),
                lit = drawing.projector_image(0, room.posed, room.viewer);
  const sim::PartImage seen = judge.parts_image(room.rig.cameras[0]), shone = judge.projector_image(0);
  const cv::Mat1b seen_outline =
                      outline_of_caps(seen.light, other_judge.parts_image(room.rig.cameras[0]).light),
                  shone_outline = outline_of_caps(shone.light, other_judge.projector_image(0).light);
  EXPECT_GT(cv::countNonZero(seen_outline), 200);
  const Difference on_screen = difference(drawn, seen, 0, seen_outline),
                   in_light = difference(lit, shone, 2.2, shone_outline);
  std::printf("composite: mean %.2f levels, %.1f %% over 4; light: %.2f, %.1f %%\n", on_screen.mean,
              100 * on_screen.far_share, in_light.mean, 100 * in_light.far_share);
  for (const Difference& each : {on_screen, in_light}) {
    EXPECT_LE(each.mean, 1.2);
    EXPECT_LE(each.far_share, 0.06);
  }
  if (HasFailure()) {
    EXPECT_TRUE(write_png(test::test_folder() / "drawn.png", drawn));
    cv::Mat wanted;
    seen.light.convertTo(wanted, CV_8UC3, 255);
    EXPECT_TRUE(write_png(test::test_folder() / "judged.png", wanted));
    EXPECT_TRUE(write_png(test::test_folder() / "lit.png", lit));
  }
}

}  // namespace
}  // namespace limn::projector
