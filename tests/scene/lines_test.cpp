#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "exchange/curves/csv_curves.h"
#include "exchange/curves/dxf_curves.h"
#include "scene/actions.h"
#include "scene/lines/drape.h"
#include "scene/lines/line.h"
#include "scene/lines/outline.h"
#include "scene/lines/stroke_font.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
namespace fs = std::filesystem;

json lined_scene() {
  return {
      {"schema", "limn.scene/1"},
      {"prototype", {{"mesh", "clay.obj"}, {"units", "m"}}},
      {"slots", json::array()},
      {"lines",
       {{{"name", "every 50"},
         {"colour", {1, 0.5, 0}},
         {"width_mm", 0.5},
         {"sections", {{"axis", "y"}, {"every_mm", 50}, {"offset_mm", 10}}}},
        {{"name", "dots"},
         {"shown", false},
         {"pattern",
          {{"form", "dots"},
           {"spacing_mm", 20},
           {"size_mm", {300, 200}},
           {"prototype_from_pattern", {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {0.1, 0, 0}}}}}}},
        {{"name", "character"}, {"curve", {{"points_mm", {{100, 100, 1}, {300, 200, -1}, {400, 100, 0}}}}}},
        {{"name", "from a file"}, {"curve", {{"file", "curve.csv"}}}}}}};
}

Result<Scene> loaded(const json& scene) {
  const fs::path folder = test::test_folder();
  EXPECT_TRUE(write_file(folder / "scene.json", scene.dump()));
  EXPECT_TRUE(write_file(folder / "clay.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  EXPECT_TRUE(write_file(folder / "curve.csv", "name,x_mm,y_mm,z_mm\na,10,10,0\na,20,10,0\na,10,10,0\n"));
  return load_scene(folder);
}

TEST(Lines, EveryKeyIsRead) {
  const auto scene = loaded(lined_scene());
  ASSERT_TRUE(scene) << scene.message();
  ASSERT_EQ(scene->lines.size(), 4U);
  EXPECT_EQ(first_lines(*scene), (std::vector<std::string>{"every 50", "character", "from a file"}));
  const Line &sections = scene->lines[0], &dots = scene->lines[1], &curve = scene->lines[2];
  EXPECT_EQ(sections.style.colour, Vector3d(1, 0.5, 0));
  EXPECT_NEAR(sections.style.width_m, 0.5e-3, 1e-12);
  ASSERT_TRUE(sections.repeated && dots.repeated && !curve.repeated);
  // The planes' axis is the x axis of the lines' frame.
  const Pose from_prototype = sections.repeated->prototype_from_lines.inverse();
  EXPECT_NEAR((from_prototype * Vector3d(0.3, 0.11, -0.2)).x(), 0.1, 1e-12);
  EXPECT_NEAR(sections.repeated->spacing_m, 0.05, 1e-12);
  EXPECT_EQ(dots.repeated->form, RepeatedLines::Form::dots);
  EXPECT_TRUE(test::near(dots.repeated->half_size_m, Eigen::Vector2d(0.15, 0.1), 1e-12));
  EXPECT_EQ(dots.repeated->prototype_from_lines.translation.x(), 0.1);
  ASSERT_EQ(curve.curves.size(), 1U);
  EXPECT_FALSE(curve.curves[0].is_closed);
  for (const SurfacePoint& point : curve.curves[0].points) EXPECT_NEAR(point.p.z(), 0, 1e-9);  // on the mesh
  ASSERT_EQ(scene->lines[3].curves.size(), 1U);
}

TEST(Lines, WhatIsWrongIsNamed) {
  const auto message = [](const std::function<void(json*)>& change) {
    json scene = lined_scene();
    change(&scene["lines"]);
    const auto found = loaded(scene);
    return found ? std::string("(no error)") : found.message();
  };
  const auto expect = [](const std::string& found, const char* words) {
    EXPECT_NE(found.find(words), std::string::npos) << words << " in: " << found;
  };
  expect(message([](json* l) { (*l)[0]["sections"]["every_mm"] = 0; }),
         "lines[0].sections.every_mm: expected 0.5 to 20000 mm");
  expect(message([](json* l) { (*l)[0]["sections"]["axis"] = "w"; }), "axis");
  expect(message([](json* l) { (*l)[0]["width_mm"] = 1e9; }), "lines[0].width_mm: expected 0.05 to 20 mm");
  expect(message([](json* l) { (*l)[0]["colour"] = {2, 0, 0}; }), "linear light from 0 to 1");
  expect(message([](json* l) { (*l)[1]["name"] = "every 50"; }), "expected a unique name");
  expect(message([](json* l) { (*l)[1]["name"] = ""; }), "expected a name of 1 to 64 bytes");
  expect(message([](json* l) { (*l)[0].erase("sections"); }), "found none");
  expect(message([](json* l) { (*l)[0]["curve"] = (*l)[2]["curve"]; }), "found several");
  expect(message([](json* l) { (*l)[2]["curve"]["points_mm"] = {{1, 2, 3}}; }), "expected 2 to 4000 points");
  expect(message([](json* l) {
           (*l)[2]["curve"]["points_mm"][1] = {300, 200, 500};
         }),
         "line 'character': expected points within 20 mm of the prototype");
  expect(message([](json* l) {
           (*l)[2]["curve"]["points_mm"] = {{1, 2, 0}, {1, 2, 0}};
         }),
         "expected at least 2 different points");
  expect(message([](json* l) { (*l)[3]["curve"]["file"] = "none.csv"; }), "none.csv");
  expect(message([](json* l) { (*l)[3]["curve"]["file"] = "clay.obj"; }), "another ending");
  expect(message([](json* l) { (*l)[3]["curve"]["points_mm"] = json::array(); }), "found both");
}

TEST(Lines, AreSwitchedByAnActionAndKeptByLooks) {
  const auto scene = loaded(lined_scene());
  ASSERT_TRUE(scene) << scene.message();
  ShowState state = initial_show_state(*scene);
  const auto shown = [&] { return compose_scene(*scene, state, {}).lines; };
  const auto done = [&](const std::string& action, const std::string& line, const std::string& value) {
    const auto after = apply_edit(*scene, state, compose_scene(*scene, state, {}), Edit{action, line, value});
    if (after) state = *after;
    return after ? std::string() : after.message();
  };
  EXPECT_NE(done("line", "gold", "on").find("expected one of the lines (every 50, dots"), std::string::npos);
  EXPECT_EQ(done("line", "dots", ""), "");
  EXPECT_EQ(done("line", "every 50", "off"), "");
  EXPECT_EQ(shown(), (std::vector<std::string>{"character", "from a file", "dots"}));
  DrawnLine drawn{
      "stroke", {{0, 1, 0}, 1e-3}, {{{{0.1, 0.1, 0}, {0, 0, 1}}, {{0.2, 0.1, 0}, {0, 0, 1}}}, true}};
  state.drawn = {drawn};
  EXPECT_EQ(done("line", "stroke", "on"), "");
  EXPECT_EQ(compose_scene(*scene, state, {}).drawn, (std::vector<DrawnLine>{drawn}));
  EXPECT_EQ(done("save_look", "", "evening"), "");
  EXPECT_EQ(done("line", "", "off"), "");
  EXPECT_TRUE(shown().empty());
  // A look from its file, also after the drawn line is gone.
  const fs::path file = scene->folder / "evening.json";
  ASSERT_TRUE(write_file(file, look_json(state.looks[0])));
  const auto look = load_look(file, *scene);
  ASSERT_TRUE(look) << look.message();
  state.drawn.clear();
  state = with_look(*scene, state, *look);
  EXPECT_EQ(shown(), (std::vector<std::string>{"character", "from a file", "dots"}));
  EXPECT_EQ(compose_scene(*scene, state, {}).drawn, (std::vector<DrawnLine>{drawn}));
  // A look of an older version: the lines that the scene shows at first.
  ASSERT_TRUE(write_file(file, R"({"schema": "limn.look/1", "name": "old", "slots": {}})"));
  const auto old = load_look(file, *scene);
  ASSERT_TRUE(old) << old.message();
  state = with_look(*scene, state, *old);
  EXPECT_EQ(shown(), first_lines(*scene));
}

// A sheet z = 0.02 cos(x / 0.05) over x and y from -0.15 to 0.15 m, with a back at a distance below it.
double height_at(double x) { return 0.02 * std::cos(x / 0.05); }
Mesh wavy_shell(double thickness, bool is_inverted) {
  Mesh mesh;
  constexpr int k_count = 300;
  for (const double below : {0.0, thickness})
    for (int i = 0; i <= k_count; ++i)
      for (const double y : {-0.15, 0.15}) {
        const double x = 0.3 * i / k_count - 0.15;
        mesh.positions.push_back(Vector3d(x, y, height_at(x) - below).cast<float>());
        mesh.normals.emplace_back(0, 0, below > 0 ? -1 : 1);
      }
  for (const std::uint32_t side : {0U, 1U})
    for (std::uint32_t i = 0; i < k_count; ++i) {
      const std::uint32_t a = side * 2 * (k_count + 1) + 2 * i;
      const bool flips = (side == 1) != is_inverted;
      for (std::array<std::uint32_t, 3> t : {std::array{a, a + 2, a + 3}, std::array{a, a + 3, a + 1}}) {
        if (flips) std::swap(t[1], t[2]);
        mesh.triangles.push_back(t);
      }
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  mesh.materials.emplace_back();
  return mesh;
}

TEST(Lines, CurvesFollowTheSurfaceAndStayOnOneSideOfAThinShell) {
  for (const bool is_inverted : {false, true}) {
    const Mesh mesh = wavy_shell(0.6e-3, is_inverted);
    const Drape drape(mesh);
    // One point is nearer to the back than to the front.
    exchange::NamedCurve curve{"c", {}, false};
    for (const double x : {-0.12, -0.04, 0.03, 0.11})
      curve.points.emplace_back(x, 0.5 * x, height_at(x) + (x == 0.03 ? -0.45e-3 : 0.1e-3));
    const auto laid = drape.laid(curve, "c");
    ASSERT_TRUE(laid) << laid.message();
    double worst_mm = 0;
    const double towards = is_inverted ? -1 : 1;
    for (std::size_t i = 0; i + 1 < laid->points.size(); ++i) {
      EXPECT_GT(towards * laid->points[i].d_normal.z(), 0.5);
      for (int k = 0; k <= 10; ++k) {
        const Vector3d p = laid->points[i].p + 0.1 * k * (laid->points[i + 1].p - laid->points[i].p);
        const double slope = 0.4 * std::sin(p.x() / 0.05);
        worst_mm = std::max(worst_mm, 1e3 * std::abs(p.z() - height_at(p.x())) / std::hypot(1, slope));
      }
    }
    fmt::print("{} points, at most {:.3f} mm off the surface\n", laid->points.size(), worst_mm);
    EXPECT_LT(worst_mm, 0.1);
    EXPECT_LT(laid->points.size(), 400U);
  }
}

TEST(Lines, MeshesThatWindInconsistentlyHaveNoSides) {
  Mesh mesh = wavy_shell(0.5e-3, false);
  EXPECT_TRUE(winds_consistently(mesh));
  std::swap(mesh.triangles[7][0], mesh.triangles[7][1]);
  EXPECT_FALSE(winds_consistently(mesh));
  const Drape drape(mesh);
  const auto laid = drape.laid({"c", {{-0.1, 0, height_at(-0.1)}, {0.1, 0, height_at(0.1)}}, false}, "c");
  ASSERT_TRUE(laid) << laid.message();
  EXPECT_TRUE(laid->points[0].d_normal.isZero());
}

TEST(Lines, PointsThatAreNoCurveAreRefused) {
  const Mesh mesh = wavy_shell(1e-3, false);
  const Drape drape(mesh);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(drape.laid({"c", {{0, 0, 0.02}, {nan, 0, 0}}, false}, "c").message().find("finite"),
            std::string::npos);
  EXPECT_NE(drape.laid({"c", {{0, 0, 0.02}, {0, 0, 0.02}}, false}, "c").message().find("different"),
            std::string::npos);
  EXPECT_NE(drape.laid({"c", {{0, 0, 0.02}, {0, 0, 2}}, false}, "c").message().find("20 mm"),
            std::string::npos);
}

// A flat sheet z = 0 of 0.4 x 0.4 m that faces +z, or with `is_inverted` winds the other way.
Mesh flat_sheet(bool is_inverted) {
  Mesh mesh;
  for (const float x : {-0.2F, 0.2F})
    for (const float y : {-0.2F, 0.2F}) mesh.positions.emplace_back(x, y, 0.0F);
  mesh.normals.assign(4, Eigen::Vector3f(0, 0, is_inverted ? -1.0F : 1.0F));
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}};
  if (is_inverted)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  mesh.triangle_materials.assign(2, 0);
  return mesh;
}

TEST(Lines, TextsAndDimensionsAreReadableFromWhereTheyAreRead) {
  for (const bool is_inverted : {false, true}) {
    const Drape drape(flat_sheet(is_inverted));
    std::vector<Line> lines(2);
    const Vector3d p_reader(0, 0, 1);
    lines[0].name = "text";
    lines[0].text = LineText{"L 7", {0.05, 0.02, 0.001}, {1, 0, 0}, 0.06, p_reader};
    lines[1].name = "dimension";
    // From right to left; 3-4-5, so that the straight distance is 125 mm.
    lines[1].dimension = LineDimension{{0.05, -0.0375, 0}, {-0.05, 0.0375, 0}, 0.01, p_reader};
    const Status laid = lay_lines(drape, &lines);
    ASSERT_TRUE(laid) << laid.message();
    // The foot of the L goes to the right from its stem, as seen from z.
    const SurfaceCurve& letter = lines[0].curves[0];
    EXPECT_TRUE(test::near(letter.points.front().p, Vector3d(0.05, 0.08, 0), 1e-6));
    EXPECT_TRUE(test::near(letter.points.back().p, Vector3d(0.09, 0.02, 0), 1e-6));
    // A line, two ticks and the number; the number is above the line and runs to the right.
    const StrokeText number = stroke_text("125.0");
    ASSERT_EQ(lines[1].curves.size(), 3 + number.strokes.size());
    EXPECT_NEAR((lines[1].curves[0].points.back().p - lines[1].curves[0].points.front().p).norm(), 0.125,
                1e-9);
    const SurfaceCurve &one = lines[1].curves[3], &last = lines[1].curves.back();
    EXPECT_LT(one.points[0].p.x(), last.points[0].p.x());
    const Vector3d above(0.0375, 0.05, 0);  // across the line, towards y
    for (std::size_t i = 3; i < lines[1].curves.size(); ++i)
      for (const SurfacePoint& point : lines[1].curves[i].points) EXPECT_GT(point.p.dot(above), 0);
  }
}

TEST(Lines, ThePartsOutlineIsLaidAlongItsAxis) {
  const Drape drape(wavy_shell(0.01, false));
  Mesh plate;  // 80 x 40 mm, 30 mm above the surface's mean
  for (const float x : {-0.04F, 0.04F})
    for (const float y : {-0.02F, 0.02F}) plate.positions.emplace_back(x, y, 0.03F);
  plate.triangles = {{0, 2, 3}, {0, 3, 1}};
  const auto outline = outline_of(plate);
  ASSERT_EQ(outline.rings.size(), 1U);
  const Pose prototype_from_part(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Vector3d::UnitZ())),
                                 {0.02, 0.01, 0});
  const auto curves = laid_outline(drape, outline, prototype_from_part);
  ASSERT_EQ(curves.size(), 1U);
  EXPECT_TRUE(curves[0].is_closed);
  double worst_mm = 0;
  for (const SurfacePoint& point : curves[0].points) {
    EXPECT_NEAR(point.p.z(), height_at(point.p.x()), 0.1e-3);
    EXPECT_GT(point.d_normal.z(), 0.5);
    const Vector3d q = prototype_from_part.inverse() * point.p;
    worst_mm = std::max(worst_mm, 1e3 * std::abs(std::max(std::abs(q.x()) - 0.04, std::abs(q.y()) - 0.02)));
  }
  fmt::print("outline: {} points, at most {:.3f} mm off\n", curves[0].points.size(), worst_mm);
  EXPECT_LT(worst_mm, 0.2);  // of an image whose pixels are 0.04 mm
}

TEST(Lines, RaysMeetTheSurface) {
  const Drape drape(wavy_shell(1e-3, false));
  double worst_um = 0;
  for (int i = 0; i < 200; ++i) {
    const Vector3d p(0.3, -0.2, 1.0),
        target(-0.14 + 0.0014 * i, 0.001 * i - 0.1, height_at(-0.14 + 0.0014 * i));
    const auto hit = drape.hit(p, (target - p).normalized(), 5);
    ASSERT_TRUE(hit) << i;
    worst_um = std::max(worst_um, 1e6 * (hit->p - target).norm());
  }
  EXPECT_LT(worst_um, 100);  // of the mesh's chords
  EXPECT_FALSE(drape.hit({0, 0, 1}, {0, 0, 1}, 5));
  EXPECT_FALSE(drape.hit({1, 0, 1}, {0, 0, -1}, 5));
}

// A show state in which lines are drawn on a wavy shell.
struct Drawing {
  Scene scene;
  ShowState state;

  Drawing() { scene.drape = std::make_shared<const Drape>(wavy_shell(1e-3, false)); }
  std::string done(const std::string& action, const std::string& line, const std::string& value = "") {
    const auto after = apply_edit(scene, state, {}, Edit{action, line, value});
    if (after) state = *after;
    return after ? std::string() : after.message();
  }
  const std::vector<SurfacePoint>& points() const { return state.drawn.at(0).curve.points; }
};

Vector3d on_sheet(double t) { return {0.2 * t - 0.1, 0.1 * t - 0.05, height_at(0.2 * t - 0.1)}; }

double distance_to(const std::vector<SurfacePoint>& points, const Vector3d& p) {
  double nearest = 1;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const Vector3d a = points[i].p, ab = points[i + 1].p - a;
    const double along = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (a + along * ab - p).norm());
  }
  return nearest;
}

// As a tablet sends it: some rays at a time.
TEST(DrawnLines, AStrokeLiesWhereItWasDrawn) {
  Drawing drawing;
  const Vector3d p_eye(0.2, -0.3, 0.8);
  for (int begin = 0; begin <= 200; begin += 20) {
    std::string value = fmt::format("rays {} {} {}", 1e3 * p_eye.x(), 1e3 * p_eye.y(), 1e3 * p_eye.z());
    for (int i = begin; i < std::min(begin + 20, 201); ++i) {
      const Vector3d d = (on_sheet(i / 200.0) - p_eye).normalized();
      value += fmt::format(" {:.8f} {:.8f} {:.8f}", d.x(), d.y(), d.z());
    }
    ASSERT_EQ(drawing.done("draw_line", "edge", value), "");
  }
  ASSERT_EQ(drawing.state.drawn.size(), 1U);
  EXPECT_EQ(drawing.state.lines, std::vector<std::string>{"edge"});
  double worst_mm = 0;
  for (int i = 0; i <= 1000; ++i)
    worst_mm = std::max(worst_mm, 1e3 * distance_to(drawing.points(), on_sheet(i / 1000.0)));
  fmt::print("stroke: {} points, at most {:.3f} mm from where it was drawn\n", drawing.points().size(),
             worst_mm);
  EXPECT_LT(worst_mm, 0.5);
  EXPECT_LT(drawing.points().size(), 200U);
  // What misses the prototype is left out; alone it is refused.
  EXPECT_EQ(drawing.done("draw_line", "edge", "rays 0 0 500 0 0 1 0.1 0 -1"), "");
  EXPECT_NE(drawing.done("draw_line", "edge", "rays 0 0 500 0 0 1").find("none of its points"),
            std::string::npos);
}

TEST(DrawnLines, AreSmoothedMovedRenamedAndErased) {
  Drawing drawing;
  std::string value = "points";
  for (int i = 0; i <= 100; ++i) {  // with a tremble of 1 mm, 5 mm long
    const Vector3d p = 1e3 * on_sheet(i / 100.0);
    value += fmt::format(" {} {} {}", p.x(), p.y() + std::sin(2 * M_PI * i * 2.236 / 5), p.z());
  }
  ASSERT_EQ(drawing.done("draw_line", "", value), "");
  EXPECT_EQ(drawing.state.drawn[0].name, "line-01");
  const auto tremble_mm = [&] {
    double worst = 0;
    for (const SurfacePoint& point : drawing.points())
      if (std::abs(point.p.x()) < 0.08)
        worst = std::max(worst, 1e3 * std::abs(point.p.y() - 0.5 * point.p.x()));
    return worst;
  };
  const Vector3d first = drawing.points().front().p, last = drawing.points().back().p;
  EXPECT_GT(tremble_mm(), 0.8);
  ASSERT_EQ(drawing.done("smooth_line", ""), "");
  EXPECT_LT(tremble_mm(), 0.4);
  EXPECT_LT((drawing.points().front().p - first).norm(), 0.05e-3);
  EXPECT_LT((drawing.points().back().p - last).norm(), 0.05e-3);
  for (const SurfacePoint& point : drawing.points()) EXPECT_NEAR(point.p.z(), height_at(point.p.x()), 0.1e-3);
  // Its middle is pulled by 12 mm along the surface; its ends stay.
  ASSERT_EQ(drawing.done("move_line", "line-01", "points 1 1 20 0 12 20"), "");
  EXPECT_LT(distance_to(drawing.points(), {0, 0.012, 0.02}), 0.5e-3);
  EXPECT_LT((drawing.points().front().p - first).norm(), 0.05e-3);
  for (const SurfacePoint& point : drawing.points()) EXPECT_NEAR(point.p.z(), height_at(point.p.x()), 0.1e-3);
  EXPECT_NE(drawing.done("move_line", "line-01", "points 100 -100 -8 0 12 20").find("15 mm"),
            std::string::npos);
  ASSERT_EQ(drawing.done("rename_line", "line-01", "sill"), "");
  EXPECT_EQ(drawing.state.lines, std::vector<std::string>{"sill"});
  EXPECT_NE(drawing.done("erase_line", "line-01").find("expected a drawn line (sill)"), std::string::npos);
  ASSERT_EQ(drawing.done("erase_line", ""), "");
  EXPECT_TRUE(drawing.state.lines.empty() && drawing.state.drawn.empty());
  EXPECT_NE(drawing.done("erase_line", "").find("found none"), std::string::npos);
}

TEST(DrawnLines, WhatIsNoStrokeIsRefused) {
  Drawing drawing;
  for (const char* value : {"", "points", "rays 0 0 1", "points 1 2", "points 1 2 x", "circles 1 2 3",
                            "points nan 0 0", "points 1e300 0 0", "rays 0 0 500 0 0 0", "points 1 2 3 4"})
    EXPECT_NE(drawing.done("draw_line", "edge", value).find("draw_line: expected"), std::string::npos)
        << value;
  EXPECT_NE(drawing.done("draw_line", std::string(100, 'a'), "points 0 0 20").find("64 bytes"),
            std::string::npos);
  std::string many = "points";
  for (int i = 0; i < 402; ++i) many += " 0 0 20";
  EXPECT_NE(drawing.done("draw_line", "edge", many).find("at most 400"), std::string::npos);
  Scene bare;
  EXPECT_NE(apply_edit(bare, {}, {}, Edit{"draw_line", "edge", "points 0 0 0"}).message().find("prototype"),
            std::string::npos);
  // In all, 4000 points are drawn at most.
  int strokes = 0;
  std::string refusal;
  while (refusal.empty() && strokes < 200) {
    std::string value = "points";
    for (int i = 0; i < 300; ++i)
      value += fmt::format(" {} {} 18", (i % 2 ? 40 : -40) + 0.01 * i, 0.4 * i - 60);
    refusal = drawing.done("draw_line", fmt::format("l{}", strokes++), value);
  }
  EXPECT_NE(refusal.find("at most 4000 points"), std::string::npos);
}

TEST(CsvCurves, ComeInAgainAsTheyWere) {
  std::vector<exchange::NamedCurve> curves(2);
  curves[0] = {"a \"b\", c", {{0.1, -0.2, 0.30000001}, {0.1234567, 0, 1}, {5, 6, 7}}, true};
  curves[1] = {"second", {{0, 0, 0}, {1, 1, 1}}, false};
  const auto again = exchange::decode_csv_curves(exchange::encode_csv_curves(curves), "curves.csv");
  ASSERT_TRUE(again) << again.message();
  ASSERT_EQ(again->size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ((*again)[i].name, curves[i].name);
    EXPECT_EQ((*again)[i].is_closed, curves[i].is_closed);
    ASSERT_EQ((*again)[i].points.size(), curves[i].points.size());
    for (std::size_t k = 0; k < curves[i].points.size(); ++k)
      EXPECT_LT(((*again)[i].points[k] - curves[i].points[k]).norm(), 0.05e-3);  // m
  }
}

TEST(CsvCurves, ARowThatIsWrongIsNamed) {
  const auto message = [](const std::string& text) {
    return exchange::decode_csv_curves(text, "c.csv").message();
  };
  EXPECT_NE(message("").find("found none"), std::string::npos);
  EXPECT_NE(message("a,1,2,3\na,1,2\n").find("row 2"), std::string::npos);
  EXPECT_NE(message("a,1,2,3\n\"a,1,2,3\n").find("quote"), std::string::npos);
  EXPECT_NE(message("a,1,2,3\na,nan,2,3\n").find("row 2"), std::string::npos);
  EXPECT_NE(message("a,1,2,3\na,1e300,2,3\n").find("row 2"), std::string::npos);
  EXPECT_NE(message("a,1,2,3\nb,1,2,3\n").find("at least 2 points"), std::string::npos);
}

TEST(DxfCurves, ComeInAgainAsTheyWere) {
  std::vector<exchange::NamedCurve> curves(2);
  curves[0] = {"character line", {{0.1, -0.2, 0.30000001}, {0.1234567, 0, 1}, {5, 6, 7}}, true};
  curves[1] = {"second", {{0, 0, 0}, {1, 1, 1}}, false};
  const auto again = exchange::decode_dxf_curves(exchange::encode_dxf_curves(curves), "curves.dxf");
  ASSERT_TRUE(again) << again.message();
  EXPECT_TRUE(again->warnings.empty());
  ASSERT_EQ(again->curves.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again->curves[i].name, curves[i].name);
    EXPECT_EQ(again->curves[i].is_closed, curves[i].is_closed);
    ASSERT_EQ(again->curves[i].points.size(), curves[i].points.size());
    for (std::size_t k = 0; k < curves[i].points.size(); ++k)
      EXPECT_LT((again->curves[i].points[k] - curves[i].points[k]).norm(), 0.05e-3);  // m
  }
}

// A file as a CAD program writes it, in inches: pairs of code and value.
std::string dxf(const std::string& header, const std::string& entities) {
  std::string text =
      "0 SECTION 2 HEADER " + header + "0 ENDSEC 0 SECTION 2 ENTITIES " + entities + "0 ENDSEC 0 EOF ";
  std::replace(text.begin(), text.end(), ' ', '\n');
  return text;
}

TEST(DxfCurves, OtherProgramsEntitiesAreRead) {
  const std::string inches = "9 $INSUNITS 70 1 ";
  const auto one = [&](const std::string& entities) {
    const auto list = exchange::decode_dxf_curves(dxf(inches, entities), "c.dxf");
    EXPECT_TRUE(list) << list.message();
    return list ? list->curves.at(0) : exchange::NamedCurve();
  };
  const auto line = one("0 LINE 8 a 10 1 20 2 30 3 11 4 21 5 31 6 ");
  EXPECT_EQ(line.name, "a");
  EXPECT_LT((line.points[1] - 0.0254 * Vector3d(4, 5, 6)).norm(), 1e-12);
  // A bulge of 1 is half a circle, to the right of the way from its start to its end: about (1, 0), below.
  const auto arc = one("0 LWPOLYLINE 8 a 90 2 70 0 38 2 10 0 20 0 42 1 10 2 20 0 ");
  double lowest = 0;
  for (const Vector3d& p : arc.points) {
    EXPECT_NEAR((p / 0.0254 - Vector3d(1, 0, 2)).norm(), 1, 1e-9);
    lowest = std::min(lowest, p.y() / 0.0254);
  }
  EXPECT_NEAR(lowest, -1, 1e-3);
  // Bezier as a spline of degree 2: at its middle a quarter, a half and a quarter of its control points.
  const auto spline =
      one("0 SPLINE 8 a 70 8 71 2 72 6 73 3 40 0 40 0 40 0 40 1 40 1 40 1 10 0 20 0 30 0 10 1 20 2 30 0 10 2 "
          "20 0 30 4 ");
  EXPECT_LT((spline.points[16] / 0.0254 - Vector3d(1, 1, 1)).norm(), 1e-9);
  EXPECT_LT((spline.points.back() / 0.0254 - Vector3d(2, 0, 4)).norm(), 1e-9);
  const auto circle = one("0 CIRCLE 8 a 10 1 20 1 30 0 40 2 ");
  EXPECT_TRUE(circle.is_closed);
  EXPECT_GT(circle.points.size(), 300U);
  const auto polyline =
      one("0 POLYLINE 8 a 66 1 70 9 0 VERTEX 8 a 10 0 20 0 30 1 0 VERTEX 8 a 10 1 20 0 30 1 0 VERTEX 8 a "
          "10 1 20 1 30 1 0 SEQEND ");
  EXPECT_TRUE(polyline.is_closed && polyline.points.size() == 3);
  const auto without_unit = exchange::decode_dxf_curves(
      dxf("", "0 TEXT 8 a 10 1 20 1 0 LINE 8 a 10 1 20 2 30 3 11 4 21 5 31 6 "), "c.dxf");
  ASSERT_TRUE(without_unit) << without_unit.message();
  EXPECT_LT((without_unit->curves[0].points[0] - 1e-3 * Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_EQ(without_unit->warnings.size(), 2U);  // the unit; TEXT is left out
}

TEST(DxfCurves, WhatIsWrongIsNamedWithItsLine) {
  const auto message = [](const std::string& text) {
    const auto found = exchange::decode_dxf_curves(text, "c.dxf");
    return found ? std::string("(no error)") : found.message();
  };
  const std::string mm = "9 $INSUNITS 70 4 ";
  EXPECT_NE(message("AutoCAD Binary DXF\r\n").find("binary"), std::string::npos);
  EXPECT_NE(message("hello\nworld\n").find("line 1"), std::string::npos);
  EXPECT_NE(message("").find("another text"), std::string::npos);
  EXPECT_NE(message(dxf(mm, "")).find("found none"), std::string::npos);
  EXPECT_NE(message(dxf("9 $INSUNITS 70 20 ", "0 LINE 8 a 10 1 20 2 11 4 21 5 ")).find("$INSUNITS"),
            std::string::npos);
  EXPECT_NE(message(dxf(mm, "0 LINE 8 a 10 nan 20 2 11 4 21 5 ")).find("line 20"), std::string::npos);
  EXPECT_NE(message(dxf(mm, "0 LINE 8 a 10 1e300 20 2 11 4 21 5 ")).find("at most"), std::string::npos);
  EXPECT_NE(message(dxf(mm, "0 SPLINE 8 a 71 3 40 0 10 0 20 0 ")).find("expected a spline"),
            std::string::npos);
  EXPECT_NE(message(dxf(mm, "0 SPLINE 8 a 71 2000000 40 0 10 0 20 0 ")).find("expected a spline"),
            std::string::npos);
}

}  // namespace
}  // namespace limn::scene
