// Curves out to STEP and in again, against their closed form and against the text of the file.
#include "scene/lines/line_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <regex>
#include <string>
#include <vector>

#include "core/file.h"
#include "exchange/curves/curve_list.h"
#include "tests/exchange/cad_folder.h"
#include "tests/exchange/iges_text.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using exchange::CurveForm;
using exchange::NamedCurve;
using test::Cad;
using test::IgesText;
using test::StepText;

class LineFile : public Cad {
 protected:
  std::vector<NamedCurve> read(const fs::path& file, bool with_edges = false) const {
    auto curves = scene::read_line_file(file, with_edges);
    EXPECT_TRUE(curves) << curves.message();
    return curves ? *curves : std::vector<NamedCurve>();
  }

  std::vector<NamedCurve> out_and_in(const std::vector<NamedCurve>& curves, CurveForm form) const {
    const Status written = scene::write_line_file(curves, folder / "lines.step", form);
    EXPECT_TRUE(written) << written.message();
    return read(folder / "lines.step");
  }
};

// A line around a door's edge: a helix of 60 mm with a pitch of 100 mm.
Vector3d helix(double t) { return {0.060 * std::cos(t), 0.060 * std::sin(t), 0.100 * t / (2 * M_PI)}; }

NamedCurve helix_line(int points) {
  NamedCurve curve{.name = "character line \xC3\xBC"};
  for (int i = 0; i < points; ++i) curve.points.push_back(helix(4.0 * i / (points - 1)));
  return curve;
}

NamedCurve square() { return {"square", {{0, 0, 0}, {0.1, 0, 0}, {0.1, 0.1, 0}, {0, 0.1, 0.01}}, true}; }

// The largest distance of points along the polyline from what `distance` measures.
double worst_along(const NamedCurve& curve, const std::function<double(const Vector3d&)>& distance) {
  double worst = 0;
  for (std::size_t i = 0; i + 1 < curve.points.size(); ++i)
    for (int k = 0; k <= 10; ++k)
      worst = std::max(worst, distance(curve.points[i] + 0.1 * k * (curve.points[i + 1] - curve.points[i])));
  return worst;
}

double from_helix(const Vector3d& p) {
  double t = p.z() * 2 * M_PI / 0.100;  // then Newton along the curve
  for (int i = 0; i < 10; ++i) {
    const Vector3d along(-0.060 * std::sin(t), 0.060 * std::cos(t), 0.100 / (2 * M_PI));
    t += (p - helix(t)).dot(along) / along.squaredNorm();
  }
  return (p - helix(t)).norm();
}

TEST_F(LineFile, APolylineComesInAgainAsItWas) {
  const std::vector<NamedCurve> lines = {helix_line(200), square(), {"b", {{0, 0, 0}, {0, 0, 1}}}};
  const auto again = out_and_in(lines, CurveForm::polyline);
  ASSERT_EQ(again.size(), lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    EXPECT_EQ(again[i].name, lines[i].name);
    EXPECT_EQ(again[i].is_closed, lines[i].is_closed);
    ASSERT_EQ(again[i].points.size(), lines[i].points.size()) << lines[i].name;
    for (std::size_t k = 0; k < lines[i].points.size(); ++k)
      EXPECT_TRUE(test::near(again[i].points[k], lines[i].points[k], 1e-9)) << lines[i].name << " " << k;
  }
}

TEST_F(LineFile, ASplineStaysOnTheCurveThatItsPointsAreFrom) {
  NamedCurve circle{.name = "circle", .is_closed = true};
  for (int i = 0; i < 36; ++i)
    circle.points.emplace_back(0.05 * std::cos(i * M_PI / 18), 0.05 * std::sin(i * M_PI / 18), 0);
  const auto again = out_and_in({helix_line(40), circle}, CurveForm::spline);
  ASSERT_EQ(again.size(), 2u);
  EXPECT_LE(worst_along(again[0], from_helix), 0.05e-3);  // the issue's limit
  EXPECT_TRUE(test::near(again[0].points.front(), helix(0), 1e-9));
  EXPECT_TRUE(test::near(again[0].points.back(), helix(4), 1e-9));
  EXPECT_TRUE(again[1].is_closed);
  EXPECT_LE(
      worst_along(again[1],
                  [](const Vector3d& p) { return std::abs(p.head<2>().norm() - 0.05) + std::abs(p.z()); }),
      0.05e-3);
}

// The file's text says what other programs read.
TEST_F(LineFile, TheFileIsAp242InMillimetresWithTheCurvesNames) {
  ASSERT_TRUE(scene::write_line_file({{"sill \xC3\xBC's", {{0, 0, 0}, {0.25, 0, 0}, {0.25, 0.125, 0}}}},
                                     folder / "lines.stp"));
  const std::string text = read_file(folder / "lines.stp").value();
  EXPECT_TRUE(std::regex_search(text, std::regex("FILE_SCHEMA\\s*\\(\\(\\s*'AP242")));
  EXPECT_TRUE(std::regex_search(text, std::regex("SI_UNIT\\(\\.MILLI\\.,\\.METRE\\.\\)")));
  EXPECT_NE(text.find(R"(PRODUCT('sill \X2\00FC\X0\''s')"), std::string::npos) << text;
  EXPECT_TRUE(std::regex_search(text, std::regex("CARTESIAN_POINT\\('[^']*',\\(250\\.,125\\.,0\\.\\)\\)")))
      << text;
  EXPECT_FALSE(fs::exists(folder / ".lines.stp.curves.json")) << "it is only for limn-cad";
}

TEST_F(LineFile, CurvesOfOtherProgramsAreRead) {
  StepText step("inch");
  const int corner = step.point({0, 0, 0}), end = step.point({1, 0, 0}), top = step.point({1, 2, 0});
  const int bent = step.add("POLYLINE('bent',(#{},#{},#{}))", corner, end, top);
  const int circle = step.add("CIRCLE('round',#{},{:.9E})", step.frame({0, 0, 3}), 2.0);
  const int set = step.add("GEOMETRIC_CURVE_SET('',(#{},#{}))", bent, circle);
  step.product("drawing", {set}, "GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION");
  const auto curves = read(write("drawing.step", step.file()));
  ASSERT_EQ(curves.size(), 2u);
  EXPECT_EQ(curves[0].name, "bent");
  ASSERT_EQ(curves[0].points.size(), 3u);
  EXPECT_TRUE(test::near(curves[0].points[2], 0.0254 * Vector3d(1, 2, 0), 1e-9));
  EXPECT_EQ(curves[1].name, "round");
  EXPECT_TRUE(curves[1].is_closed);
  const auto from_circle = [](const Vector3d& p) {
    return std::hypot(p.head<2>().norm() - 0.0508, p.z() - 0.0762);
  };
  EXPECT_LE(worst_along(curves[1], from_circle), 0.01e-3);
  EXPECT_GT(worst_along(curves[1], from_circle), 0.0005e-3) << "far too many points";
}

TEST_F(LineFile, SegmentsThatTheFileJoinsAreOneCurve) {
  StepText step;
  const int a = step.point({0, 0, 0}), b = step.point({10, 0, 0}), c = step.point({10, 10, 0}),
            d = step.point({20, 10, 0});
  const int lines[] = {step.add("POLYLINE('',(#{},#{}))", a, b), step.add("POLYLINE('',(#{},#{}))", c, b),
                       step.add("POLYLINE('',(#{},#{}))", c, d)};
  std::string segments;
  for (std::size_t i = 0; i < 3; ++i)
    segments += fmt::format(
        "{}#{}", i == 0 ? "" : ",",
        step.add("COMPOSITE_CURVE_SEGMENT(.CONTINUOUS.,{},#{})", i == 1 ? ".F." : ".T.", lines[i]));
  const int whole = step.add("COMPOSITE_CURVE('steps',({}),.F.)", segments);
  const int set = step.add("GEOMETRIC_CURVE_SET('',(#{}))", whole);
  step.product("drawing", {set}, "GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION");
  const auto curves = read(write("steps.step", step.file()));
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_EQ(curves[0].name, "steps");
  const std::vector<Vector3d> corners = {{0, 0, 0}, {0.01, 0, 0}, {0.01, 0.01, 0}, {0.02, 0.01, 0}};
  ASSERT_EQ(curves[0].points.size(), corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i)
    EXPECT_TRUE(test::near(curves[0].points[i], corners[i], 1e-9)) << i;
}

TEST_F(LineFile, EdgesOfSurfacesAreReadWhenAskedFor) {
  StepText step;
  step.part("box", {step.box({10, 20, 30})});
  const fs::path file = write("box.step", step.file());
  const auto refused = scene::read_line_file(file);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.message().find("box.step: expected a STEP file with curves"), std::string::npos)
      << refused.message();
  const auto edges = read(file, true);
  ASSERT_EQ(edges.size(), 12u);
  double sum = 0;
  for (const NamedCurve& edge : edges) sum += (edge.points.back() - edge.points.front()).norm();
  EXPECT_NEAR(sum, 4 * 0.060, 1e-9);
  EXPECT_EQ(edges[0].name, "box");
  EXPECT_EQ(edges[1].name, "box 2");
}

TEST_F(LineFile, SplinesAndEdgesAreOfStepAlone) {
  const std::vector<NamedCurve> lines = {square()};
  const Status written = scene::write_line_file(lines, folder / "lines.csv", CurveForm::spline);
  EXPECT_NE(written.message().find("lines.csv: expected .step or .stp, because splines"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "lines.csv"));
  ASSERT_TRUE(scene::write_line_file(lines, folder / "lines.dxf"));
  const auto edges = scene::read_line_file(folder / "lines.dxf", true);
  ASSERT_FALSE(edges);
  EXPECT_NE(edges.message().find("lines.dxf: expected a STEP or IGES file"), std::string::npos);
}

TEST_F(LineFile, WhatIsNoCurveIsRefusedBeforeAnythingIsWritten) {
  const fs::path file = write("lines.step", "the old file");
  const auto refusal_of = [&](const std::vector<NamedCurve>& curves) {
    const Status status = scene::write_line_file(curves, file);
    return status ? "" : status.message();
  };
  EXPECT_NE(refusal_of({}).find("found none"), std::string::npos);
  EXPECT_NE(refusal_of({{"dot", {{0, 0, 0}}}}).find("'dot': expected at least 2 points, found 1"),
            std::string::npos);
  EXPECT_NE(refusal_of({{"far", {{0, 0, 0}, {NAN, 0, 0}}}}).find("finite"), std::string::npos);
  EXPECT_NE(refusal_of({{"still", {{0, 0, 0}, {0, 0, 0}}}}).find("0 and 1 equal"), std::string::npos);
  EXPECT_EQ(read_file(file).value(), "the old file");
  const auto damaged = scene::read_line_file(file);
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.message().find("lines.step: expected a whole STEP file"), std::string::npos);
}

}  // namespace
}  // namespace limn
