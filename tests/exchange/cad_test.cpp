// STEP and IGES files: what limn-cad makes of files whose truth is known, as meshes load them.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <tuple>

#include "exchange/cad_import.h"
#include "scene/files/cad_program.h"
#include "scene/meshes/mesh.h"
#include "tests/exchange/cad_folder.h"
#include "tests/exchange/iges_text.h"
#include "tests/exchange/step_text.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using Eigen::Vector3f;
using nlohmann::json;
using test::box_file;
using test::box_of;
using test::Cad;
using test::IgesText;
using test::StepText;
using namespace test::literals;

TEST_F(Cad, ABoxHasItsSizeInEveryUnitAndSchema) {
  struct Case {
    const char *unit, *schema, *protocol;
    double metres;
  };
  for (const Case& c : {Case{"mm", "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }", "AP214", 1e-3},
                        Case{"inch", "CONFIG_CONTROL_DESIGN", "AP203", 0.0254},
                        Case{"m", "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF", "AP242", 1}}) {
    const json found = report(write("box.step", box_file(c.unit, c.schema)));
    EXPECT_EQ(found["application_protocol"], c.protocol);
    EXPECT_DOUBLE_EQ(found["metres_per_unit"].get<double>(), c.metres) << c.unit;
    ASSERT_EQ(found["solids"].size(), 1u);
    EXPECT_EQ(found["solids"][0]["name"], "T\xC3\xBCrgriff");
    EXPECT_TRUE(found["solids"][0]["closed"].get<bool>());
    EXPECT_EQ(found["triangles"], 12);
    const auto box = box_of(found["solids"][0]);
    EXPECT_TRUE(test::near(box.min(), Vector3d::Zero(), 1e-6 * c.metres));
    EXPECT_TRUE(test::near(box.max(), c.metres * Vector3d(100, 50, 20), 1e-3 * 20 * c.metres)) << c.unit;
  }
}

TEST_F(Cad, InstancesShareAMesh) {
  StepText step("inch");
  const auto bolt = step.part("bolt", {step.box({1, 1, 2})}),
             plate = step.part("plate", {step.box({10, 10, 1})});
  const auto whole = step.assembly("whole"), pair = step.assembly("pair");
  step.place(whole, plate, {0, 0, 0}, "p");
  step.place(whole, pair, {0, 0, 1}, "pair");
  step.place(pair, bolt, {2, 2, 0}, "b1");
  step.place(pair, bolt, {7, 7, 0}, "b2");
  const json found = report(write("whole.stp", step.file()));
  ASSERT_EQ(found["solids"].size(), 3u);
  EXPECT_EQ(found["meshes"], 2);
  std::map<std::string, int> names;
  for (const json& solid : found["solids"]) ++names[solid["name"]];
  EXPECT_EQ(names, (std::map<std::string, int>{{"bolt", 2}, {"plate", 1}}));
  for (const json& solid : found["solids"]) {
    if (solid["name"] != "bolt") continue;
    EXPECT_EQ(solid["path"], json({"whole", "pair"}));
    const double at = box_of(solid).min().x() < 0.1 ? 2 : 7;
    EXPECT_TRUE(test::near(box_of(solid).min(), 0.0254 * Vector3d(at, at, 1), 1e-6));
    EXPECT_TRUE(test::near(box_of(solid).max(), 0.0254 * Vector3d(at + 1, at + 1, 3), 1e-6));
  }
}

TEST_F(Cad, ColoursOfSolidsAndFacesAreLinear) {
  StepText step;
  std::vector<int> faces;
  const int painted = step.box({10, 10, 10}, &faces);
  step.part("painted", {painted});
  step.paint(painted, {0.5, 0.25, 1});
  step.paint(faces[1], {1, 0, 0});  // z = 10 mm
  const scene::Mesh mesh = load(write("painted.step", step.file()));
  int red = 0, others = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    bool on_top = true;
    for (const auto corner : mesh.triangles[t]) on_top &= mesh.positions[corner].z() > 0.0099F;
    const Vector3f& colour = mesh.materials[mesh.triangle_materials[t]].base_colour;
    EXPECT_TRUE(
        test::near(colour.cast<double>(), on_top ? Vector3d(1, 0, 0) : Vector3d(0.21404, 0.05088, 1), 1e-3));
    ++(on_top ? red : others);
  }
  EXPECT_EQ(red, 2);
  EXPECT_EQ(others, 10);
}

// The largest distance of points on a mesh from a surface, of which `distance` tells it, over 10 000 points.
double worst_of(const scene::Mesh& mesh, const std::function<double(const Vector3d&)>& distance) {
  auto rng = test::test_rng();
  double worst = 0;
  for (int i = 0; i < 10000; ++i) {
    const auto& triangle = mesh.triangles[rng() % mesh.triangles.size()];
    double a = test::uniform(rng, 0, 1), b = test::uniform(rng, 0, 1);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const Vector3d p =
        (mesh.positions[triangle[0]].cast<double>() * (1 - a - b) +
         mesh.positions[triangle[1]].cast<double>() * a + mesh.positions[triangle[2]].cast<double>() * b);
    worst = std::max(worst, std::abs(distance(p)));
  }
  return worst;
}

TEST_F(Cad, TheChordErrorHoldsOnCurvedSurfaces) {
  StepText balls, rings;
  balls.part("ball", {balls.sphere(40)});
  rings.part("ring", {rings.torus(30, 8)});
  const scene::Mesh ball = load(write("ball.step", balls.file())),
                    ring = load(write("ring.step", rings.file()));
  const auto from_ball = [](const Vector3d& p) { return p.norm() - 0.040; };
  const auto from_ring = [](const Vector3d& p) {
    return std::hypot(std::hypot(p.x(), p.y()) - 0.030, p.z()) - 0.008;
  };
  ASSERT_FALSE(ball.triangles.empty() || ring.triangles.empty());
  EXPECT_LE(worst_of(ball, from_ball), 0.1_mm);
  EXPECT_LE(worst_of(ring, from_ring), 0.1_mm);
  EXPECT_GT(worst_of(ball, from_ball), 0.001_mm) << "far too many triangles";
  for (std::size_t i = 0; i < ball.positions.size(); ++i)  // normals are the surface's own, outwards
    EXPECT_GT(ball.normals[i].dot(ball.positions[i].normalized()), 0.9999F);
  StepText small;  // is cut to a share of its size
  small.part("pearl", {small.sphere(1)});
  const auto from_pearl = [](const Vector3d& p) { return p.norm() - 0.001; };
  EXPECT_LE(worst_of(load(write("pearl.step", small.file())), from_pearl), 0.001_mm);
  const json fine = report(folder / "ring.step", {"--chord-mm", "0.01"});
  EXPECT_LE(fine["chord_error_mm"].get<double>(), 0.01);
  EXPECT_LE(worst_of(load(folder / "out.glb"), from_ring), 0.01_mm);
}

// At a tip the surface's parameters say nothing, so the error there must not be measured between them.
TEST_F(Cad, ATipIsNotCutFinerThanTheRest) {
  StepText step;
  step.part("tip", {step.cone(5, 3)});
  const json found = report(write("tip.step", step.file()), {"--chord-mm", "0.2"});
  EXPECT_TRUE(found["warnings"].empty()) << found["warnings"];
  EXPECT_LE(found["chord_error_mm"].get<double>(), 0.2);
  EXPECT_GT(found["chord_error_mm"].get<double>(), 0.001);
  EXPECT_LE(found["triangles"].get<int>(), 200);
  EXPECT_EQ(found["solids"].size(), 1U);
}

TEST_F(Cad, AByteOrderMarkIsNoFault) {
  StepText step;
  step.part("box", {step.box({10, 20, 30})});
  const json plain = report(write("box.step", step.file()));
  EXPECT_EQ(report(write("box.step", "\xEF\xBB\xBF" + step.file()))["solids"], plain["solids"]);
}

TEST_F(Cad, AShapeThatTakesTooLongGetsALargerChordErrorThatIsStated) {
  StepText step;
  step.part("ball", {step.sphere(20)});
  const json found =
      report(write("ball.step", step.file()), {"--chord-mm", "0.0005", "--solid-seconds", "0.05"});
  const double error_mm = found["chord_error_mm"];
  EXPECT_GT(error_mm, 0.0005);
  EXPECT_LT(error_mm, 2);
  EXPECT_NE(found["warnings"].dump().find("larger than 0.0005 mm in 1 faces"), std::string::npos)
      << found["warnings"];
  EXPECT_LE(worst_of(load(folder / "out.glb"), [](const Vector3d& p) { return p.norm() - 0.020; }),
            1.02e-3 * error_mm);
}

// ---- IGES

TEST_F(Cad, AnIgesBoxHasItsSizeAndColourInEveryUnit) {
  struct Case {
    int number;
    const char* name;
    double metres;
  };
  for (const Case& c : {Case{2, "MM", 1e-3}, Case{1, "INCH", 0.0254}, Case{6, "M", 1}, Case{3, "MM", 1e-3}}) {
    IgesText iges(c.number, c.name);
    iges.box({1, 2, 3}, {5, 10, 21}, iges.colour({50, 25, 100}));
    const json found = report(write("box.igs", iges.file()));
    EXPECT_EQ(found["format"], "IGES");
    EXPECT_DOUBLE_EQ(found["metres_per_unit"].get<double>(), c.metres) << c.name;
    ASSERT_EQ(found["solids"].size(), 1u) << c.name;
    const json& box = found["solids"][0];
    EXPECT_TRUE(box["closed"].get<bool>()) << "six surfaces become one";
    EXPECT_EQ(found["triangles"], 12);
    EXPECT_TRUE(test::near(box_of(box).min(), c.metres * Vector3d(1, 2, 3), 1e-6 * c.metres)) << c.name;
    EXPECT_TRUE(test::near(box_of(box).max(), c.metres * Vector3d(5, 10, 21), 3e-6 * c.metres)) << c.name;
    ASSERT_EQ(box["colours"].size(), 1u);
    const Vector3d colour(box["colours"][0][0], box["colours"][0][1], box["colours"][0][2]);
    EXPECT_TRUE(test::near(colour, Vector3d(0.21404, 0.05088, 1), 1e-3));
  }
}

TEST_F(Cad, RoundIgesSurfacesKeepTheChordError) {
  IgesText rods, balls;
  rods.cylinder(10, 30);
  balls.sphere(20);
  const scene::Mesh rod = load(write("rod.iges", rods.file())), ball = load(write("ball.igs", balls.file()));
  ASSERT_FALSE(rod.triangles.empty() || ball.triangles.empty());
  EXPECT_LE(worst_of(ball, [](const Vector3d& p) { return p.norm() - 0.020; }), 0.1_mm);
  EXPECT_LE(worst_of(rod,
                     [](const Vector3d& p) {
                       const double side = std::hypot(p.x(), p.y()) - 0.010;
                       return std::min({std::abs(side), std::abs(p.z()), std::abs(p.z() - 0.030)});
                     }),
            0.1_mm);
  EXPECT_TRUE(test::near(box_of(rod).min().cast<double>(), Vector3d(-0.010, -0.010, 0), 0.1_mm));
  EXPECT_TRUE(test::near(box_of(rod).max().cast<double>(), Vector3d(0.010, 0.010, 0.030), 0.1_mm));
  for (std::size_t i = 0; i < ball.positions.size(); ++i)
    EXPECT_GT(ball.normals[i].dot(ball.positions[i].normalized()), 0.9999F) << "outwards";
}

TEST_F(Cad, IgesSubfiguresAreInstancesWithTheirNames) {
  IgesText iges(1, "INCH");
  iges.begin_subfigure();
  const int bolt = iges.end_subfigure("bolt", iges.box({0, 0, 0}, {1, 2, 3}, 3));  // green
  iges.place(bolt, {10, 0, 0});
  iges.place(bolt, {20, 5, 0});
  iges.box({-5, -5, -5}, {0, 0, 0});
  const json found = report(write("rest.igs", iges.file()));
  ASSERT_EQ(found["solids"].size(), 3u) << found;
  EXPECT_EQ(found["meshes"], 2);
  std::map<std::string, int> names;
  for (const json& solid : found["solids"]) ++names[solid["name"]];
  EXPECT_EQ(names, (std::map<std::string, int>{{"bolt", 2}, {"rest", 1}}));
  for (const json& solid : found["solids"]) {
    EXPECT_TRUE(solid["closed"].get<bool>()) << solid;
    if (solid["name"] != "bolt") continue;
    EXPECT_EQ(solid["colours"], json({{0.0, 1.0, 0.0, 1.0}}));
    const Vector3d low = box_of(solid).min().x() < 0.3 ? Vector3d(10, 0, 0) : Vector3d(20, 5, 0);
    EXPECT_TRUE(test::near(box_of(solid).min(), 0.0254 * low, 1e-6));
    EXPECT_TRUE(test::near(box_of(solid).max(), 0.0254 * (low + Vector3d(1, 2, 3)), 1e-6));
  }
}

TEST_F(Cad, AnEmptyIgesNameCostsTheNamesAlone) {
  IgesText iges;
  const int name = iges.add(406, 15, "1", 0, true);
  const int first = iges.line({0, 0, 0}, {1, 0, 0}), second = iges.line({0, 1, 0}, {1, 1, 0});
  iges.add(118, 1, fmt::format("{},{},0,0,0,1,{}", first, second, name));
  const json found = report(write("plate.igs", iges.file()));
  ASSERT_EQ(found["solids"].size(), 1u);
  EXPECT_EQ(found["solids"][0]["name"], "plate");
  EXPECT_NE(found["warnings"].dump().find("one of the names is empty"), std::string::npos)
      << found["warnings"];
}

TEST_F(Cad, SolidsBecomePartsOrVariants) {
  StepText step;
  const auto bolt = step.part("bolt", {step.box({1, 1, 2})});
  const auto pair =
      step.part("two", {step.box({3, 3, 3}, nullptr, "left"), step.box({4, 4, 4}, nullptr, "right")});
  const auto whole = step.assembly("whole");
  step.place(whole, bolt, {2, 2, 0}, "b1");
  step.place(whole, bolt, {7, 7, 0}, "b2");
  step.place(whole, pair, {0, 0, 5}, "p");
  exchange::CadImportOptions options{.file = write("whole.step", step.file()), .out = folder / "parts"};
  options.as = exchange::CadTakenAs::parts;
  ASSERT_TRUE(exchange::import_cad(options));
  const auto names = [](const fs::path& in) {
    std::set<std::string> found;
    for (const auto& entry : fs::directory_iterator(in)) found.insert(entry.path().filename().string());
    return found;
  };
  EXPECT_EQ(names(folder / "parts"),
            (std::set<std::string>{"bolt.glb", "bolt 2.glb", "left.glb", "right.glb"}));
  options.as = exchange::CadTakenAs::variants;
  options.out = folder / "variants";
  ASSERT_TRUE(exchange::import_cad(options));
  EXPECT_EQ(names(folder / "variants"), (std::set<std::string>{"bolt.glb", "left.glb", "right.glb"}));
  const scene::Mesh second = load(folder / "parts" / "bolt 2.glb");
  EXPECT_TRUE(test::near(box_of(second).center().cast<double>(), Vector3d(0.0075, 0.0075, 0.001), 1e-6));
  options.as = exchange::CadTakenAs::part;
  EXPECT_NE(exchange::import_cad(options).message().find("--out: expected a file NAME.glb"),
            std::string::npos);
}

// ---- bad input

TEST_F(Cad, DamagedFilesAreRefusedByTheirName) {
  const std::string whole = box_file("mm", "AUTOMOTIVE_DESIGN");
  const auto says = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  says(refusal(write("empty.step", "")), "empty.step: expected a");
  says(refusal(write("cut.step", whole.substr(0, whole.size() / 2))), "cut.step: expected a");
  says(refusal(write("text.igs", "this is no IGES file\n")), "text.igs: expected a");
  IgesText iges;
  iges.box({0, 0, 0}, {1, 1, 1});
  iges.box({2, 0, 0}, {3, 1, 1});
  const std::string boxes = iges.file();
  says(refusal(write("cut.igs", boxes.substr(0, boxes.size() - 200))), "cut.igs: expected a whole IGES file");
  says(refusal(folder / "absent.step"), "found no file");
  StepText nothing;
  nothing.part("empty", {});
  says(refusal(write("nothing.step", nothing.file())), "found only points, curves and hidden shapes");
}

TEST_F(Cad, AnAssemblyThatContainsItselfIsRefused) {
  StepText step;
  const auto outer = step.assembly("outer"), inner = step.assembly("inner");
  step.place(outer, inner, {0, 0, 0}, "a");
  step.place(inner, outer, {0, 0, 0}, "b");
  step.place(inner, step.part("box", {step.box({1, 1, 1})}), {0, 0, 0}, "c");
  const std::string text = refusal(write("circle.step", step.file()));
  EXPECT_NE(text.find("outer -> inner -> outer"), std::string::npos) << text;
}

TEST_F(Cad, AssembliesWithinAssembliesHaveABound) {
  StepText step;
  auto inner = step.part("bolt", {step.box({1, 1, 1})});
  for (int level = 0; level < 6; ++level) {
    const auto outer = step.assembly("level " + std::to_string(level));
    for (int i = 0; i < 8; ++i) step.place(outer, inner, {2.0 * i, 0, 0}, std::to_string(i));
    inner = outer;
  }
  const std::string text = refusal(write("nested.step", step.file()));
  EXPECT_NE(text.find("nested.step: expected at most 200000 placed parts, found more"), std::string::npos)
      << text;
}

TEST_F(Cad, WhatIsNotWholeIsShownWithAWarning) {
  StepText open, unitless("none");
  open.part("lid", {open.box({10, 10, 10}, nullptr, "", true)});
  const json lid = report(write("lid.step", open.file()));
  EXPECT_FALSE(lid["solids"][0]["closed"].get<bool>());
  EXPECT_EQ(lid["warnings"], json({"'lid': the surface does not close (4 open edges)"}));
  unitless.part("box", {unitless.box({10, 10, 10})});
  const json box = report(write("box.step", unitless.file()));
  EXPECT_NE(box["warnings"].dump().find("no length unit"), std::string::npos) << box["warnings"];
}

TEST_F(Cad, ShapesThatAreNotReadAreNamed) {
  StepText step;
  const int block = step.add("BLOCK('',#{},1.,2.,3.)", step.frame({0, 0, 0}));
  const int solid = step.add("CSG_SOLID('',#{})", block);
  step.product("csg", {solid}, "CSG_SHAPE_REPRESENTATION");
  const std::string text = refusal(write("csg.step", step.file()));
  EXPECT_NE(text.find("csg.step: expected a STEP file with surfaces, found only CSG solids"),
            std::string::npos)
      << text;
  step.part("box", {step.box({1, 1, 1})});
  const json found = report(write("both.step", step.file()));
  EXPECT_EQ(found["solids"].size(), 1u);
  EXPECT_EQ(found["warnings"], json({"CSG solids are left out"}));
}

TEST_F(Cad, HiddenShapesAreLeftOut) {
  StepText step;
  const int shown = step.box({10, 10, 10}, nullptr, "shown"),
            hidden = step.box({90, 90, 90}, nullptr, "inner");
  step.hide(hidden);
  step.part("both", {shown, hidden});
  const json found = report(write("both.step", step.file()));
  ASSERT_EQ(found["solids"].size(), 1u) << found;
  EXPECT_TRUE(test::near(box_of(found["solids"][0]).max(), Vector3d::Constant(0.01), 1e-6)) << found;
  EXPECT_EQ(found["warnings"], json({"1 hidden shape is left out"}));

  StepText face;
  std::vector<int> faces;
  face.part("box", {face.box({10, 10, 10}, &faces)});
  face.hide(faces[0]);
  const json box = report(write("box.step", face.file()));
  EXPECT_TRUE(box["solids"][0]["closed"].get<bool>()) << box;

  StepText nothing;
  const int all = nothing.box({10, 10, 10});
  nothing.part("nothing", {all});
  nothing.hide(all);
  EXPECT_NE(refusal(write("nothing.step", nothing.file())).find("hidden shapes"), std::string::npos);
}

TEST_F(Cad, NamedSurfacesOfAProductAreApart) {
  StepText step;
  std::vector<int> models;
  for (const char* name : {"left", "right"}) {
    std::vector<int> faces;
    step.box({10, 20, 30}, &faces);
    const int shell = step.add("OPEN_SHELL('',(#{}))", faces[0]);
    models.push_back(step.add("SHELL_BASED_SURFACE_MODEL('{}',(#{}))", name, shell));
  }
  step.product("door", models, "MANIFOLD_SURFACE_SHAPE_REPRESENTATION");
  const json found = report(write("door.step", step.file()));
  ASSERT_EQ(found["solids"].size(), 2u) << found;
  EXPECT_EQ(found["solids"][0]["name"], "left");
  EXPECT_EQ(found["solids"][1]["name"], "right");
}

TEST_F(Cad, TooManyTrianglesAreRefusedWithAChordErrorThatWouldDo) {
  StepText step;
  const auto ball = step.part("ball", {step.sphere(25)});
  auto whole = ball;
  for (int level = 0; level < 5; ++level) {  // 32 balls
    const auto outer = step.assembly(fmt::format("level {}", level));
    step.place(outer, whole, {0, 0, 0}, "a");
    step.place(outer, whole, {1, 0, 0}, "b");
    whole = outer;
  }
  const fs::path file = write("balls.step", step.file());
  std::vector<std::string> arguments = {"--out", (folder / "out.glb").string(), "--most-triangles", "20000"};
  const auto refused = scene::run_limn_cad(file, arguments);
  ASSERT_FALSE(refused) << *refused;
  const std::string& text = refused.message();
  EXPECT_NE(text.find("expected at most 0.02 million triangles"), std::string::npos) << text;
  const std::size_t at = text.find("--chord-mm ");
  ASSERT_NE(at, std::string::npos) << text;
  arguments.insert(arguments.end(), {"--chord-mm", text.substr(at + 11)});
  const auto coarse = scene::run_limn_cad(file, arguments);
  ASSERT_TRUE(coarse) << coarse.message();
  EXPECT_GT(json::parse(*coarse)["triangles"].get<std::size_t>(), 1000u);
}

TEST_F(Cad, WhatIsNoFileIsNamedAsSuch) {
  exchange::CadImportOptions options{.file = folder / "absent.step", .out = folder / "out.glb"};
  const auto says = [&](const char* part) {
    const Status imported = exchange::import_cad(options);
    ASSERT_FALSE(imported);
    EXPECT_NE(imported.message().find(part), std::string::npos) << imported.message();
    const auto alone = scene::run_limn_cad(options.file, {"--out", options.out.string()}, {.seconds = 5});
    ASSERT_FALSE(alone);
    EXPECT_NE(alone.message().find(part), std::string::npos) << alone.message();
  };
  says("absent.step: expected a file, found no file");
  options.file = folder / "pipe.step";
  ASSERT_EQ(mkfifo(options.file.c_str(), 0600), 0);
  says("pipe.step: expected a file, found a pipe");
  options.file = folder / "folder.step";
  fs::create_directory(options.file);
  says("folder.step: expected a file, found a folder");
}

// An assembly of a box and of a part in a file of its own.
std::string with_reference(const std::string& name) {
  StepText step;
  const auto whole = step.assembly("whole");
  step.place(whole, step.part("box", {step.box({1, 2, 3})}), {0, 0, 0}, "a");
  const auto other = step.assembly("other");
  step.place(whole, other, {10, 0, 0}, "b");
  step.refer(other, name);
  return step.file();
}

TEST_F(Cad, FilesThatAFileRefersToAreReadBelowItsFolderAlone) {
  StepText part;
  part.part("part", {part.box({5, 5, 5})});
  write("part.step", part.file());
  fs::create_directories(folder / "in" / "sub");
  write("in/sub/part.step", part.file());
  EXPECT_EQ(report(write("in/good.step", with_reference("sub/part.step")))["solids"].size(), 2u);
  for (const std::string& name : {std::string("../part.step"), std::string("sub\\\\..\\\\..\\\\part.step"),
                                  (folder / "part.step").string(), std::string("/dev/zero")}) {
    const std::string text = refusal(write("in/bad.step", with_reference(name)));
    EXPECT_NE(text.find("bad.step: expected that it refers only to files in its folder"), std::string::npos)
        << name << ": " << text;
  }
  const fs::path late = write("in/late.step", with_reference("gone.step"));
  const json without = report(late);
  EXPECT_EQ(without["solids"].size(), 1u);
  EXPECT_NE(without["warnings"].dump().find("'gone.step', a file that it refers to, is absent"),
            std::string::npos)
      << without["warnings"];
  EXPECT_EQ(load(late).triangles.size(), 12u);
  write("in/gone.step", part.file());
  EXPECT_EQ(load(late).triangles.size(), 24u) << "what was kept without the part";
  write("in/gone.step", "no STEP file");
  EXPECT_NE(report(late)["warnings"].dump().find("'gone.step', a file that it refers to, cannot be parsed"),
            std::string::npos);
}

TEST_F(Cad, AnImportKeepsFilesThatItDidNotMake) {
  StepText both, one;
  both.part("bolt", {both.box({1, 1, 2})});
  both.part("nut", {both.box({1, 1, 1})});
  one.part("bolt", {one.box({1, 1, 3})});
  exchange::CadImportOptions options{.file = write("all.step", both.file()), .out = folder / "slot"};
  options.as = exchange::CadTakenAs::variants;
  ASSERT_TRUE(exchange::import_cad(options));
  write("all.step", one.file());
  testing::internal::CaptureStderr();
  ASSERT_TRUE(exchange::import_cad(options));
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_NE(log.find("also has files of an earlier import of this file, which stay: nut.glb"),
            std::string::npos)
      << log;
  EXPECT_FLOAT_EQ(box_of(load(folder / "slot/bolt.glb")).sizes().z(), 0.003F);
  write("slot/bolt.glb", "somebody's own");
  const Status refused = exchange::import_cad(options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.message().find("slot/bolt.glb: expected no file or one that was made of all.step"),
            std::string::npos)
      << refused.message();
  EXPECT_EQ(read_file(folder / "slot/bolt.glb").value(), "somebody's own");
}

TEST_F(Cad, NamesInOldCodePagesAreRead) {
  const auto name_of = [&](const std::string& bytes) {
    StepText step;
    step.part(bytes, {step.box({1, 2, 3})});
    const json found = report(write("name.step", step.file()));
    EXPECT_NE(found["warnings"].dump().find("names are not UTF-8"), std::string::npos) << found["warnings"];
    return found["solids"][0]["name"].get<std::string>();
  };
  EXPECT_EQ(name_of("Fen\xEAtre"), "Fen\xC3\xAAtre");
  EXPECT_EQ(name_of("\xC1\xE3\xBC\xFE"), "\xE9\x9B\xB6\xE4\xBB\xB6");  // GBK: part
}

TEST_F(Cad, PlacesThatAreMirroredOrScaledAreNamed) {
  for (const auto& [z, scale, what] :
       {std::tuple(-1., "1.", "mirrored"), std::tuple(1., "2.", "scaled by 2"), std::tuple(1., "1.", "")}) {
    StepText step;
    const auto door = step.part("door", {step.box({1, 2, 3})});
    const int map = step.add("REPRESENTATION_MAP(#{},#{})", step.frame({0, 0, 0}), door.representation);
    const int x = step.direction({1, 0, 0}), y = step.direction({0, 1, 0}), up = step.direction({0, 0, z});
    const int origin = step.point({5, 0, 0});
    const int placed = step.add("CARTESIAN_TRANSFORMATION_OPERATOR_3D('','','',#{},#{},#{},{},#{})", x, y,
                                origin, scale, up);
    step.product("pair", {step.add("MAPPED_ITEM('left door',#{},#{})", map, placed)}, "SHAPE_REPRESENTATION");
    const std::string warnings = report(write("pair.step", step.file()))["warnings"].dump();
    if (*what)
      EXPECT_NE(warnings.find(fmt::format("'left door': a place is {}", what)), std::string::npos)
          << warnings;
    else
      EXPECT_EQ(warnings, "[]");
  }
}

// Whatever is changed in a file: a report, or one sentence; never a hang. tools/fuzz_cad does it for minutes.
TEST_F(Cad, MutatedFilesEndInASentence) {
  StepText step;
  std::vector<int> faces;
  const int box = step.box({10, 10, 10}, &faces);
  step.paint(faces[0], {1, 0, 0});
  const auto whole = step.assembly("whole");
  step.place(whole, step.part("box", {box, step.torus(9, 2)}), {1, 2, 3}, "b");
  const std::string good = step.file();
  auto rng = test::test_rng();
  for (int run = 0; run < 8; ++run) {
    std::string bad = good;
    for (int change = 0; change < 1 + run % 4; ++change)
      bad[rng() % bad.size()] = "0123456789#(),.$*'E-"[rng() % 20];
    const auto report = scene::run_limn_cad(write("bad.step", bad), {"--out", (folder / "out.glb").string()},
                                            {.seconds = 10, .memory_mb = 1024});
    if (report) {
      EXPECT_TRUE(scene::load_mesh(folder / "out.glb", {}));
    } else {
      EXPECT_NE(report.message().find("bad.step: "), std::string::npos) << report.message();
    }
  }
}

}  // namespace
}  // namespace limn
