// STEP and IGES files: what limn-cad makes of files whose truth is known, as meshes load them.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "core/data_folder.h"
#include "core/file.h"
#include "exchange/cad_import.h"
#include "scene/cad_file.h"
#include "scene/cad_program.h"
#include "scene/mesh.h"
#include "scene/scene.h"
#include "tests/exchange/step_text.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using Eigen::Vector3f;
using nlohmann::json;
using test::StepText;
using namespace test::literals;

class Cad : public testing::Test {
 protected:
  void SetUp() override {
    unsetenv("LIMN_CAD");
    if (!fs::exists(private_library("limn-cad")))
      GTEST_SKIP() << "limn-cad was not built: libocct-data-exchange-dev is not installed";
  }

  fs::path write(const std::string& name, const std::string& text) const {
    EXPECT_TRUE(write_file(folder / name, text));
    return folder / name;
  }

  // What limn-cad reports of a file.
  json report(const fs::path& file, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"--out", (folder / "out.glb").string()});
    const auto text = scene::run_limn_cad(file, more);
    EXPECT_TRUE(text) << text.message();
    return text ? json::parse(*text) : json();
  }

  scene::Mesh load(const fs::path& file, std::optional<scene::LengthUnit> units = {}) const {
    auto mesh = scene::load_mesh(file, units);
    EXPECT_TRUE(mesh) << mesh.message();
    return mesh ? std::move(*mesh) : scene::Mesh{};
  }

  std::string refusal(const fs::path& file) const {
    const auto mesh = scene::load_mesh(file, {});
    EXPECT_FALSE(mesh);
    return mesh ? "" : mesh.message();
  }

  const fs::path folder = test::test_folder();
};

std::string box_file(const std::string& unit, const std::string& schema) {
  StepText step(unit, schema);
  step.part("T\\X2\\00FC\\X0\\rgriff", {step.box({100, 50, 20})});
  return step.file();
}

Eigen::AlignedBox3f box_of(const scene::Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Vector3f& p : mesh.positions) box.extend(p);
  return box;
}

Vector3f size_of(const scene::Mesh& mesh) { return box_of(mesh).sizes(); }

Eigen::AlignedBox3d box_of(const json& solid) {
  const auto corner = [&](std::size_t i) {
    return Vector3d(solid["box_m"][i][0], solid["box_m"][i][1], solid["box_m"][i][2]);
  };
  return {corner(0), corner(1)};
}

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
  const json fine = report(folder / "ring.step", {"--chord-mm", "0.01"});
  EXPECT_LE(fine["chord_error_mm"].get<double>(), 0.01);
  EXPECT_LE(worst_of(load(folder / "out.glb"), from_ring), 0.01_mm);
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

// ---- scenes and the cache

TEST_F(Cad, ASlotsFolderTakesAStepFile) {
  fs::create_directories(folder / "slots" / "mirror");
  write("a.step", box_file("mm", "AUTOMOTIVE_DESIGN"));
  write("slots/mirror/b.STEP", box_file("inch", "CONFIG_CONTROL_DESIGN"));
  write("scene.json",
        R"({"schema": "limn.scene/1", "prototype": {"mesh": "a.step"}, "slots": [{"name": "mirror",
    "marker": "aruco_4x4_50:1", "size_mm": 40, "marker_from_part": {"rotation_wxyz": [1,0,0,0], "translation_m": [0,0,0]},
    "variants": [{"name": "a", "mesh": "a.step"}]}]})");
  for (const char* reading : {"by limn-cad", "from what it kept"}) {
    std::vector<scene::SkippedVariant> skipped;
    const auto scene = scene::load_scene(folder, &skipped);
    ASSERT_TRUE(scene) << reading << ": " << scene.message();
    EXPECT_TRUE(skipped.empty()) << reading << ": " << to_text(skipped[0]);
    ASSERT_EQ(scene->slots[0].variants.size(), 2u) << reading;
    EXPECT_EQ(scene->slots[0].variants[1].name, "b");
    EXPECT_EQ(units_question(scene->slots[0], scene->slots[0].variants[1]), "");
    setenv("LIMN_CAD", "/nowhere", 1);
  }
  unsetenv("LIMN_CAD");
}

TEST_F(Cad, WhatWasKeptIsMadeAgainWhenTheFileChanges) {
  const fs::path file = write("box.step", box_file("mm", "AUTOMOTIVE_DESIGN"));
  EXPECT_NEAR(size_of(load(file)).x(), 0.1, 1e-5);
  const fs::path kept = folder / ".box.step.glb";
  ASSERT_TRUE(fs::exists(kept));
  EXPECT_TRUE(scene::is_cad_cache_name(kept));
  EXPECT_FALSE(scene::is_cad_cache_name("box.step.glb"));
  const auto first = fs::last_write_time(kept);
  load(file);
  EXPECT_EQ(fs::last_write_time(kept), first) << "it was read again without need";
  write("box.step", box_file("m", "AUTOMOTIVE_DESIGN"));
  EXPECT_NEAR(size_of(load(file)).x(), 100, 1e-2);
  const auto other = scene::cad_as_glb(file, {.chord_mm = 0.5});
  ASSERT_TRUE(other);
  EXPECT_NE(fs::last_write_time(kept), first);
}

TEST_F(Cad, AGivenUnitReplacesTheFiles) {
  const fs::path file = write("box.step", box_file("inch", "AUTOMOTIVE_DESIGN"));
  EXPECT_NEAR(size_of(load(file)).x(), 2.54, 1e-4);
  EXPECT_NEAR(size_of(load(file, scene::LengthUnit::millimetre)).x(), 0.1, 1e-5);
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

TEST_F(Cad, TooManyTrianglesAreRefusedWithAChordErrorThatWouldDo) {
  StepText step;
  const auto ball = step.part("ball", {step.sphere(250)});
  auto whole = ball;
  for (int level = 0; level < 10; ++level) {  // 1024 balls
    const auto outer = step.assembly(fmt::format("level {}", level));
    step.place(outer, whole, {0, 0, 0}, "a");
    step.place(outer, whole, {1, 0, 0}, "b");
    whole = outer;
  }
  const std::string text = refusal(write("balls.step", step.file()));
  EXPECT_NE(text.find("expected at most 10 million triangles"), std::string::npos) << text;
  const std::size_t at = text.find("--chord-mm ");
  ASSERT_NE(at, std::string::npos) << text;
  const json coarse = report(folder / "balls.step", {"--chord-mm", text.substr(at + 11)});
  EXPECT_GT(coarse["triangles"].get<std::size_t>(), 100000u);
}

// A program that stands for limn-cad.
class OtherCad : public Cad {
 protected:
  void replace(const std::string& script) const {
    ASSERT_TRUE(write_file(folder / "other-cad", "#!/bin/bash\n" + script + "\n"));
    fs::permissions(folder / "other-cad", fs::perms::owner_all);
    setenv("LIMN_CAD", (folder / "other-cad").c_str(), 1);
  }
  std::string refusal_of(const scene::CadLimits& limits, const std::stop_token& stop = {}) const {
    const auto report = scene::run_limn_cad(folder / "a.step", {}, limits, stop);
    return report ? "" : report.message();
  }
  void TearDown() override { unsetenv("LIMN_CAD"); }
};

TEST_F(OtherCad, WithoutTheProgramAMessageSaysWhatToInstall) {
  setenv("LIMN_CAD", "/nowhere/limn-cad", 1);
  const std::string text = refusal(write("box.step", box_file("mm", "AUTOMOTIVE_DESIGN")));
  EXPECT_NE(text.find("apt install limn-cad"), std::string::npos) << text;
}

TEST_F(OtherCad, AProgramThatHangsIsEnded) {
  replace("echo $$ > '" + (folder / "pid").string() + "'; exec sleep 100");
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_NE(refusal_of({.seconds = 30, .silent_seconds = 0.5}).find("within 0 s at each step"),
            std::string::npos)
      << refusal_of({.seconds = 30, .silent_seconds = 0.5});
  EXPECT_NE(refusal_of({.seconds = 1, .silent_seconds = 30}).find("within 1 s, found"), std::string::npos);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(20));
  const auto pid = read_file(folder / "pid");
  ASSERT_TRUE(pid);
  EXPECT_FALSE(fs::exists("/proc/" + std::to_string(std::stoi(*pid)))) << "it still runs";
}

TEST_F(OtherCad, ProgressKeepsItAlive) {
  replace("for i in 1 2 3 4; do echo \"progress $i reading\"; sleep 0.3; done; echo '{}'");
  const auto report = scene::run_limn_cad(folder / "a.step", {}, {.seconds = 30, .silent_seconds = 0.9});
  ASSERT_TRUE(report) << report.message();
  EXPECT_EQ(*report, "{}\n");
}

TEST_F(OtherCad, CrashesMemoryAndMessagesBecomeOneSentence) {
  replace("kill -SEGV $$");
  EXPECT_NE(refusal_of({}).find("limn-cad crashes (Segmentation fault)"), std::string::npos);
  replace("echo noise >&2; printf 'limn-cad: a.step: it is \\001bad.\\n' >&2; exit 1");
  EXPECT_EQ(refusal_of({}), "a.step: it is bad.");
  replace("exit 3");
  EXPECT_NE(refusal_of({}).find("needs more"), std::string::npos);
  replace("ulimit -v");
  const auto limit = scene::run_limn_cad(folder / "a.step", {}, {.memory_mb = 512});
  ASSERT_TRUE(limit);
  EXPECT_EQ(*limit, "524288\n");
}

TEST_F(OtherCad, AFileThatFailedIsNotTriedAgainUntilItChanges) {
  const fs::path count = folder / "count";
  replace("echo x >> '" + count.string() + "'; echo 'limn-cad: it is bad' >&2; exit 1");
  const fs::path file = write("bad.step", "one");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(refusal(file), "it is bad");
  EXPECT_EQ(read_file(count).value(), "x\n");
  write("bad.step", "two");
  EXPECT_EQ(refusal(file), "it is bad");
  EXPECT_EQ(read_file(count).value(), "x\nx\n");
}

TEST_F(OtherCad, TheEndOfASessionEndsIt) {
  replace("exec sleep 100");
  std::stop_source stop;
  stop.request_stop();
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_NE(refusal_of({}, stop.get_token()).find("the session's end"), std::string::npos);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(5));
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
  for (int run = 0; run < 12; ++run) {
    std::string bad = good;
    for (int change = 0; change < 1 + run % 4; ++change)
      bad[rng() % bad.size()] = "0123456789#(),.$*'E-"[rng() % 20];
    const auto report = scene::run_limn_cad(write("bad.step", bad), {"--out", (folder / "out.glb").string()},
                                            {.seconds = 20, .memory_mb = 1024});
    if (!report) {
      EXPECT_FALSE(report.message().empty());
    }
  }
}

}  // namespace
}  // namespace limn
