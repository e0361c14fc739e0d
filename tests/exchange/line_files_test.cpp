// Lines of a scene out to files and in again, compared densely with each other and with their closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/data_folder.h"
#include "core/file.h"
#include "core/names.h"
#include "exchange/curves/csv_curves.h"
#include "exchange/line_export.h"
#include "exchange/line_import.h"
#include "exchange/scene_text.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"

namespace limn::exchange {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using nlohmann::json;

constexpr double k_limit_mm = 0.05;  // the issue's, of a curve out and in again

// A sheet z = 20 cos(x / 50) over x and y from -150 to 150 mm.
double height_mm(double x_mm) { return 20 * std::cos(x_mm / 50); }
std::string sheet_obj() {
  constexpr int k_count = 150;
  std::string text;
  for (int i = 0; i <= k_count; ++i)
    for (const double y : {-150.0, 150.0}) {
      const double x = 300.0 * i / k_count - 150;
      text += fmt::format("v {} {} {:.9f}\n", x, y, height_mm(x));
    }
  for (int i = 0; i < k_count; ++i) {
    const int a = 2 * i + 1;
    text += fmt::format("f {} {} {}\nf {} {} {}\n", a, a + 2, a + 3, a, a + 3, a + 1);
  }
  return text;
}

json point(double x, double y) { return {x, y, height_mm(x)}; }

json points_of(const std::vector<Eigen::Vector2d>& corners) {
  json points = json::array();
  for (const Eigen::Vector2d& at : corners) points.push_back(point(at.x(), at.y()));
  return points;
}

// A spiral that crosses the whole sheet, corners, a closed ring, two points, and a text of many strokes.
json lines_out() {
  std::vector<Eigen::Vector2d> spiral, ring;
  for (int i = 0; i <= 300; ++i) {
    const double t = 0.05 * i;
    spiral.emplace_back((20 + 6 * t) * std::cos(t), (20 + 6 * t) * std::sin(t));
  }
  for (int i = 0; i < 36; ++i) ring.emplace_back(60 * std::cos(i * M_PI / 18), 30 * std::sin(i * M_PI / 18));
  return {
      {{"name", "spiral"}, {"curve", {{"points_mm", points_of(spiral)}}}},
      {{"name", "corners"},
       {"curve",
        {{"points_mm", points_of({{-100, -100}, {-90, 50}, {-89.9, 50}, {20, 50}, {20, -70}, {100, 90}})}}}},
      {{"name", "ring"}, {"shown", false}, {"curve", {{"points_mm", points_of(ring)}, {"closed", true}}}},
      {{"name", "two"}, {"curve", {{"points_mm", points_of({{-120, 10}, {-40, 30}})}}}},
      {{"name", "label"}, {"text", {{"text", "A 17"}, {"at_mm", point(-60, -100)}, {"height_mm", 20}}}},
      {{"name", "every 50"}, {"sections", {{"axis", "y"}, {"every_mm", 50}}}}};
}

class LineFiles : public testing::Test {
 protected:
  static bool has_limn_cad() { return fs::exists(private_library("limn-cad")); }

  // A scene's folder, with a comment in its scene.json.
  fs::path scene_with(const std::string& name, const json& lines) const {
    fs::path at = folder / name;
    EXPECT_TRUE(make_folder(at));
    EXPECT_TRUE(write_file(at / "sheet.obj", sheet_obj()));
    EXPECT_TRUE(
        write_file(at / "scene.json", fmt::format(R"({{
  "schema": "limn.scene/1",  // the clay {{ of May
  "prototype": {{"mesh": "sheet.obj", "units": "mm"}},
  "slots": []{}
}})",
                                                  lines.empty() ? "" : ", \"lines\": " + lines.dump())));
    return at;
  }
  static scene::Scene loaded(const fs::path& at) {
    auto scene = scene::load_scene(at);
    EXPECT_TRUE(scene) << scene.message();
    return scene ? std::move(*scene) : scene::Scene{};
  }
  static std::string text_of(const fs::path& at) { return read_file(at / "scene.json").value(); }

  const fs::path folder = test::test_folder();
};

struct Polylines {
  std::vector<std::pair<Vector3d, Vector3d>> pieces;

  explicit Polylines(const std::vector<scene::SurfaceCurve>& curves) {
    for (const scene::SurfaceCurve& curve : curves) {
      for (std::size_t i = 1; i < curve.points.size(); ++i)
        pieces.emplace_back(curve.points[i - 1].p, curve.points[i].p);
      if (curve.is_closed) pieces.emplace_back(curve.points.back().p, curve.points.front().p);
    }
  }
  double distance_mm(const Vector3d& p) const {
    double nearest = 1;
    for (const auto& [a, b] : pieces) {
      const double along = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
      nearest = std::min(nearest, (a + along * (b - a) - p).norm());
    }
    return 1e3 * nearest;
  }
  // The largest distance of its places, ten on each piece, from the other.
  double worst_mm(const Polylines& other) const {
    double worst = 0;
    for (const auto& [a, b] : pieces)
      for (int k = 0; k <= 10; ++k) worst = std::max(worst, other.distance_mm(a + 0.1 * k * (b - a)));
    return worst;
  }
};

std::vector<scene::SurfaceCurve> curves_named(const scene::Scene& scene, const std::string& name) {
  std::vector<scene::SurfaceCurve> curves;
  for (const scene::Line& line : scene.lines)
    if (line.name == name || line.name.starts_with(name + " "))
      curves.insert(curves.end(), line.curves.begin(), line.curves.end());
  return curves;
}

TEST_F(LineFiles, LinesDifferByAtMostTheLimitOutAndInAgain) {
  const fs::path from = scene_with("from", lines_out());
  const scene::Scene before = loaded(from);
  // A drawn line that a look keeps.
  scene::Look look{.name = "evening", .parts = {}};
  scene::SurfaceCurve stroke;
  for (int i = 0; i <= 60; ++i) {
    const double x = -110 + 3.3 * i;
    stroke.points.push_back({1e-3 * Vector3d(x, 120 - 0.2 * x, height_mm(x)), Vector3d::UnitZ()});
  }
  look.lines = std::vector<std::string>{"two", "stroke"};
  look.drawn = {{"stroke", {}, stroke}};
  ASSERT_TRUE(make_folder(from / "looks"));
  ASSERT_TRUE(write_file(from / "looks" / "evening.json", scene::look_json(look)));
  for (const std::string ending : {"csv", "dxf", "step"}) {
    if (ending == "step" && !has_limn_cad()) continue;
    const fs::path file = folder / ("lines." + ending), to = scene_with("to " + ending, {});
    const Status out = export_lines({.scene = from, .out = file});
    ASSERT_TRUE(out) << out.message();
    const Status in = import_lines({.file = file, .scene = to});
    ASSERT_TRUE(in) << in.message();
    const scene::Scene after = loaded(to);
    double worst = 0;
    for (const scene::Line& line : before.lines) {
      if (line.curves.empty()) continue;
      const auto again = curves_named(after, line.name);
      ASSERT_EQ(again.size(), line.curves.size()) << line.name;
      for (std::size_t i = 0; i < again.size(); ++i)
        EXPECT_EQ(again[i].is_closed, line.curves[i].is_closed) << line.name;
      const Polylines first(line.curves), second(again);
      const double off = std::max(first.worst_mm(second), second.worst_mm(first));
      EXPECT_LE(off, k_limit_mm) << ending << " " << line.name;
      worst = std::max(worst, off);
    }
    EXPECT_LE(Polylines({stroke}).worst_mm(Polylines(curves_named(after, "stroke"))), k_limit_mm);
    EXPECT_TRUE(curves_named(after, "every").empty()) << "planes are no curves";
    fmt::print("{}: {} lines, at most {:.4f} mm off\n", ending, after.lines.size(), worst);
    // The spiral itself, at its points.
    const Polylines spiral(curves_named(after, "spiral"));
    for (int i = 0; i <= 300; ++i) {
      const double t = 0.05 * i, x = (20 + 6 * t) * std::cos(t);
      EXPECT_LE(spiral.distance_mm(1e-3 * Vector3d(x, (20 + 6 * t) * std::sin(t), height_mm(x))), 0.15)
          << "of the mesh's chords, too";
    }
  }
}

TEST_F(LineFiles, ALookOrALineAloneIsWritten) {
  const fs::path from = scene_with("from", lines_out());
  for (const auto& [name, shift] : {std::pair("day", 0.0), std::pair("night", 5.0)}) {
    scene::Look look{.name = name, .parts = {}};
    const auto at = [y = shift](double x) {
      return scene::SurfacePoint{1e-3 * Vector3d(x, y, height_mm(x)), Vector3d::UnitZ()};
    };
    look.lines = std::vector<std::string>{"ring", "trim"};
    look.drawn = {{"trim", {}, {{at(0), at(2)}, false}}};
    ASSERT_TRUE(make_folder(from / "looks"));
    ASSERT_TRUE(write_file(from / "looks" / (std::string(name) + ".json"), scene::look_json(look)));
  }
  const auto names_in = [&](LineExportOptions options) {
    options.scene = from;
    options.out = folder / "out.csv";
    const Status written = export_lines(options);
    EXPECT_TRUE(written) << written.message();
    const auto curves = decode_csv_curves(read_file(options.out).value(), "out.csv");
    EXPECT_TRUE(curves) << curves.message();
    std::vector<std::string> names;
    for (const NamedCurve& curve : *curves)
      if (names.empty() || names.back() != curve.name) names.push_back(curve.name);
    return joined_names(names);
  };
  EXPECT_EQ(names_in({}), "spiral, corners, ring, two, label, trim, trim (night)");
  EXPECT_EQ(names_in({.look = "night"}), "ring, trim");
  EXPECT_EQ(names_in({.lines = {"two", "trim"}}), "two, trim");
  const auto refusal = [&](LineExportOptions options) {
    options.scene = from;
    if (options.out.empty()) options.out = folder / "refused.csv";
    return export_lines(options).message();
  };
  EXPECT_NE(refusal({.look = "noon"}).find("--look: expected a look of the scene (day, night), found 'noon'"),
            std::string::npos);
  EXPECT_NE(refusal({.lines = {"every 50"}}).find("--line: expected a line that has a curve"),
            std::string::npos);
  EXPECT_NE(refusal({.out = folder / "lines.txt"}).find("expected .csv, .dxf, .step or .stp"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "refused.csv"));
}

TEST_F(LineFiles, AllElseInTheScenesTextStays) {
  const fs::path to = scene_with("to", lines_out());
  const std::string before = text_of(to);
  const fs::path file = folder / "sill.csv";
  ASSERT_TRUE(
      write_file(file, fmt::format("sill: a/b,0,0,{}\nsill: a/b,20,5,{}\n", height_mm(0), height_mm(20))));
  const Status in = import_lines({.file = file, .scene = to, .colour = Vector3d(1, 0.5, 0), .width_mm = 1.5});
  ASSERT_TRUE(in) << in.message();
  const std::string after = text_of(to);
  EXPECT_NE(after.find("// the clay { of May"), std::string::npos);
  EXPECT_EQ(after.substr(0, 200), before.substr(0, 200));
  const scene::Scene scene = loaded(to);
  ASSERT_EQ(scene.lines.size(), 7U);
  EXPECT_EQ(scene.lines[6].name, "sill: a/b");
  EXPECT_EQ(scene.lines[6].style.colour, Vector3d(1, 0.5, 0));
  EXPECT_NEAR(scene.lines[6].style.width_m, 1.5e-3, 1e-12);
  EXPECT_TRUE(fs::exists(to / "lines" / "sill_ a_b.csv"));
  // Again: refused, and with --replace the curve alone is another one.
  EXPECT_NE(import_lines({.file = file, .scene = to}).message().find("found 'sill: a/b'"), std::string::npos);
  EXPECT_EQ(text_of(to), after);
  ASSERT_TRUE(
      write_file(file, fmt::format("sill: a/b,0,0,{}\nsill: a/b,40,5,{}\n", height_mm(0), height_mm(40))));
  const Status again = import_lines({.file = file, .scene = to, .replace = true});
  ASSERT_TRUE(again) << again.message();
  const scene::Scene replaced = loaded(to);
  ASSERT_EQ(replaced.lines.size(), 7U);
  EXPECT_EQ(replaced.lines[6].style, scene.lines[6].style);
  EXPECT_NEAR(replaced.lines[6].curves[0].points.back().p.x(), 0.04, 1e-4);
  EXPECT_TRUE(fs::exists(to / "lines" / "sill_ a_b.csv")) << "what was saved stays";
  EXPECT_NE(import_lines({.file = file, .scene = to, .name = "every 50", .replace = true})
                .message()
                .find("lines[5]: expected a curve, found another kind of line"),
            std::string::npos);
}

TEST_F(LineFiles, WhatDoesNotLieOnThePrototypeChangesNothing) {
  const fs::path to = scene_with("to", {});
  const std::string before = text_of(to);
  const auto refusal = [&](const std::string& name, const std::string& text) {
    EXPECT_TRUE(write_file(folder / name, text));
    const Status in = import_lines({.file = folder / name, .scene = to});
    EXPECT_FALSE(in);
    EXPECT_EQ(text_of(to), before);
    EXPECT_FALSE(fs::exists(to / "lines" / "a.csv"));
    return in.message();
  };
  EXPECT_NE(refusal("far.csv", "a,0,0,20\na,0,0,90\n").find("expected points within 20 mm of the prototype"),
            std::string::npos);
  EXPECT_NE(refusal("short.csv", "a,0,0,20\n").find("expected at least 2 points"), std::string::npos);
  EXPECT_NE(refusal("words.csv", "hello\n").find("row 1"), std::string::npos);
  EXPECT_NE(refusal("nan.csv", "a,0,0,20\na,nan,0,20\n").find("row 2"), std::string::npos);
  EXPECT_NE(refusal("lines.txt", "a,0,0,20\na,1,0,20\n").find("another ending"), std::string::npos);
  EXPECT_NE(refusal("long.csv", fmt::format("{0},0,0,20\n{0},1,0,20\n", std::string(65, 'x'))).find("--name"),
            std::string::npos);
  if (has_limn_cad()) {
    EXPECT_NE(refusal("cut.step", "ISO-10303-21;").find("cut.step"), std::string::npos);
  }
  const fs::path bare = folder / "bare";
  ASSERT_TRUE(make_folder(bare));
  ASSERT_TRUE(write_file(bare / "scene.json", R"({"schema": "limn.scene/1", "slots": []})"));
  ASSERT_TRUE(write_file(folder / "a.csv", "a,0,0,20\na,1,0,20\n"));
  EXPECT_NE(import_lines({.file = folder / "a.csv", .scene = bare}).message().find("found a scene without"),
            std::string::npos);
}

TEST(SceneText, ManyWaysToWriteAFileKeepAllElse) {
  const std::string entry = R"({"name": "n", "curve": {"file": "lines/n.csv"}})";
  for (const std::string text :
       {R"({})", R"({"a": 1})", "{\"a\": [1, {\"b\": \"}\"}] // end }\n}", "{\"lines\": []}",
        "{\"lines\": [ // none\n ], \"z\": -1.5e3}",
        "\xef\xbb\xbf{ /* lines: [ */ \"lines\": [{\"name\": \"]\\\"\"}, // one\n{\"curve\": 2} // two\n]}",
        "{\"a\":{\"lines\":[1]},\"lines\":[true,null,\"x\"]}\n"}) {
    const auto out = with_lines(text, {}, {entry, entry}, "s");
    ASSERT_TRUE(out) << out.message() << text;
    json expected = json::parse(text, nullptr, true, true);
    for (int i = 0; i < 2; ++i) expected["lines"].push_back(json::parse(entry));
    EXPECT_EQ(json::parse(*out, nullptr, true, true), expected) << *out;
    for (const char* comment : {"// end }", "// none", "/* lines: [ */", "// one", "// two"})
      EXPECT_EQ(text.find(comment) == std::string::npos, out->find(comment) == std::string::npos) << *out;
  }
  const auto replaced = with_lines(R"({"lines": [{"curve": {"a": [1, 2]}, "x": 1}]})", {{0, "7"}}, {}, "s");
  ASSERT_TRUE(replaced) << replaced.message();
  EXPECT_EQ(*replaced, R"({"lines": [{"curve": 7, "x": 1}]})");
  EXPECT_FALSE(with_lines(R"({"lines": [{"x": 1}]})", {{0, "7"}}, {}, "s"));
  EXPECT_FALSE(with_lines(R"({"lines": 5})", {}, {entry}, "s"));
  EXPECT_FALSE(with_lines(R"({"lines": [], "lines": [1]})", {}, {entry}, "s"));
  for (const char* broken : {"", "{", "[1]", "{\"lines\": [", "\"", "{\"lines\": [}"})
    EXPECT_FALSE(with_lines(broken, {}, {entry}, "s")) << broken;
}

}  // namespace
}  // namespace limn::exchange
