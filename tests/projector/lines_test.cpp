// Lines of light on the prototype, against the ray tracer and seen by its camera.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "projector/changed_lines.h"
#include "scene/lines/drape.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "tests/projector/bowed_panel.h"
#include "tests/projector/judged_image.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using LinesTest = RendererTest;

scene::Line repeated(const std::string& name,
                     scene::RepeatedLines::Form form,
                     double spacing_m,
                     double width_m) {
  scene::Line line;
  line.name = name;
  line.style.width_m = width_m;
  line.style.colour = {1, 0.9, 0.2};
  line.repeated.emplace();
  line.repeated->form = form;
  line.repeated->spacing_m = spacing_m;
  return line;
}

scene::Line curve(const Mesh& mesh, const std::string& name, std::vector<Vector3d> points, double width_m) {
  scene::Line line;
  line.name = name;
  line.style.width_m = width_m;
  line.style.colour = {0.1, 0.6, 1};
  line.to_lay.push_back({name, std::move(points), false});
  std::vector<scene::Line> lines = {line};
  EXPECT_TRUE(scene::lay_lines(scene::Drape(mesh), &lines));
  return lines[0];
}

std::vector<Vector3d> across(double y) {
  std::vector<Vector3d> points;
  for (const double x : {-0.22, -0.1, 0.0, 0.1, 0.22}) points.emplace_back(x, y, bow_at(x));
  return points;
}

JudgedRoom room_of(std::vector<scene::Line> lines) {
  Scene scene = scene_of(bowed_panel(60), {});
  scene.lines = std::move(lines);
  scene::Finish dark;
  dark.name = "dark";
  dark.base_colour = {0.02, 0.02, 0.03};
  scene.finishes = {dark};
  scene.light = scene::RoomLight{k_up, {0.1, 0.1, 0.1}, {0.3, 0.3, 0.3}, {}};
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  JudgedRoom room = judged_room(std::move(rig), std::move(scene));
  for (const scene::Line& line : room.scene.lines) room.posed.lines.push_back(line.name);
  return room;
}

// Beside edges of the judge's light, pictures agree as usual: 0.5 % of pixels over 4 levels. At edges, whose
// light has eight samples, the differences of linear light have a mean of at most 0.05 and, with their signs,
// of at most 0.01: lines are neither wider nor thinner.
void expect_agreement_beside_edges(const cv::Mat& drawn,
                                   const sim::PartImage& judged,
                                   double gamma,
                                   int least) {
  cv::Mat lowest, highest;
  cv::erode(judged.light, lowest, cv::Mat::ones(3, 3, CV_8U));
  cv::dilate(judged.light, highest, cv::Mat::ones(3, 3, CV_8U));
  int count = 0, far_off = 0, edges = 0;
  double edge_sum = 0, edge_bias = 0;
  for (int row = 0; row < drawn.rows; ++row)
    for (int column = 0; column < drawn.cols; ++column) {
      if (highest.at<cv::Vec3f>(row, column)[1] <= 0) continue;
      const float wanted = judged.light.at<cv::Vec3f>(row, column)[1];
      const double level = drawn.at<cv::Vec3b>(row, column)[1] / 255.0;
      if (highest.at<cv::Vec3f>(row, column)[1] - lowest.at<cv::Vec3f>(row, column)[1] > 0.02F) {
        const double off = (gamma > 0 ? std::pow(level, gamma) : linear_from_srgb(level)) - wanted;
        ++edges;
        edge_sum += std::abs(off);
        edge_bias += off;
      } else {
        const double light = std::clamp(static_cast<double>(wanted), 0.0, 1.0);
        ++count;
        far_off +=
            std::abs(level - (gamma > 0 ? std::pow(light, 1 / gamma) : srgb_from_linear(light))) > 4 / 255.0;
      }
    }
  ASSERT_GT(count, least);
  ASSERT_GT(edges, 500);
  EXPECT_LE(far_off, 0.005 * count);
  EXPECT_LE(edge_sum / edges, 0.05);
  EXPECT_LE(std::abs(edge_bias / edges), 0.01);
}

void expect_lines_agree(Renderer* drawing, const JudgedRoom& room, int least) {
  const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
  SCOPED_TRACE(::testing::Message() << "light, then composite");
  expect_agreement_beside_edges(drawing->projector_image(0, room.posed, room.viewer),
                                judge.projector_image(0), 2.2, least);
  expect_agreement_beside_edges(composite_over_black(drawing, room), judge.parts_image(room.rig.cameras[0]),
                                0, least);
}

TEST_F(LinesTest, LightAndCompositesAreThoseOfTheRayTracer) {
  using enum scene::RepeatedLines::Form;
  const Mesh mesh = bowed_panel(60);
  scene::Line grid_in_box = repeated("grid", grid, 0.05, 0.012);
  grid_in_box.repeated->half_size_m = {0.12, 0.08};
  grid_in_box.repeated->prototype_from_lines = Pose(exp_rotation({0, 0, 0.3}), {-0.05, 0.02, 0});
  JudgedRoom room = room_of(
      {repeated("stripes", stripes, 0.06, 0.014), grid_in_box, repeated("dots", dots, 0.08, 0.03),
       curve(mesh, "curve", {{-0.2, -0.15, bow_at(0.2)}, {0, 0.1, 0}, {0.2, -0.1, bow_at(0.2)}}, 0.016)});
  Renderer drawing = renderer(room.scene, room.rig);
  for (const char* finish : {"", "dark"}) {
    for (const scene::Line& line : room.scene.lines) {
      SCOPED_TRACE(line.name + " on " + finish);
      room.posed.finish = finish;
      room.posed.lines = {line.name};
      expect_lines_agree(&drawing, room, 2000);
    }
    room.posed.lines = {"stripes", "curve"};
    expect_lines_agree(&drawing, room, 8000);
  }
}

TEST_F(LinesTest, ComeAndGo) {
  JudgedRoom room = room_of({repeated("stripes", scene::RepeatedLines::Form::stripes, 0.06, 0.002)});
  Renderer drawing = renderer(room.scene, room.rig);
  const cv::Mat grey(480, 640, CV_8UC3, cv::Scalar::all(90));
  const auto light = [&] { return drawing.projector_image(0, room.posed, room.viewer); };
  const auto screen = [&](Composite what) { return drawing.composite(0, grey, room.posed, what); };
  const cv::Mat with = light(), full = screen(Composite::full);
  EXPECT_GT(cv::countNonZero(with.reshape(1)), 2000);
  room.posed.lines.clear();
  EXPECT_EQ(cv::countNonZero(light().reshape(1)), 0);
  EXPECT_EQ(cv::norm(screen(Composite::full), grey, cv::NORM_INF), 0);
  room.posed.lines = {"stripes"};
  EXPECT_EQ(cv::norm(light(), with, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(screen(Composite::full), full, cv::NORM_INF), 0);
  // Also with contact shadows, and drawn lines that change.
  ASSERT_TRUE(drawing.set_contact_shadow(&room.scene));
  EXPECT_GT(cv::norm(screen(Composite::full), grey, cv::NORM_INF), 60);
  room.posed.lines.clear();
  const Vector3d none = Vector3d::Zero();
  room.posed.drawn = {{"s", {}, {{{{-0.1, 0, bow_at(0.1)}, none}, {{-0.1, 0.1, bow_at(0.1)}, none}}, false}}};
  EXPECT_GT(cv::norm(screen(Composite::full), grey, cv::NORM_INF), 60);
  EXPECT_GT(cv::countNonZero(light().reshape(1)), 100);
  // The other side of a thin shell keeps dark. (The panel winds one way; one of both directions is its
  // front.)
  int dark_sides = 0;
  for (const double side : {-1.0, 1.0}) {
    for (scene::SurfacePoint& point : room.posed.drawn[0].curve.points) point.d_normal = {0, 0, side};
    dark_sides += cv::countNonZero(light().reshape(1)) == 0;
  }
  EXPECT_EQ(dark_sides, 1);
}

// A drawn line along the panel, from one end to the other of its course.
scene::DrawnLine drawn_line(const std::string& name, double from, double to, double y, double wave = 0.02) {
  scene::DrawnLine line{name, {}, {}};
  line.style.colour = {0.2, 1, 0.4};
  line.style.width_m = 4e-3;
  for (double x = from; x <= to; x += 0.004)
    line.curve.points.push_back({{x, y + wave * std::sin(20 * x), bow_at(x)}, Vector3d::Zero()});
  return line;
}

// Only where a drawn line changes, the image is drawn again. It is then the same as one that is drawn whole.
TEST_F(LinesTest, ChangesOfDrawnLinesGiveTheSameImageAsAWholeOne) {
  JudgedRoom room = room_of({repeated("stripes", scene::RepeatedLines::Form::stripes, 0.06, 0.014)});
  Renderer drawing = renderer(room.scene, room.rig), whole = renderer(room.scene, room.rig);
  const auto expect_same = [&](const char* what) {
    SCOPED_TRACE(what);
    whole.set_quick_motion(true);  // another smoothing, so that the next image is drawn whole
    whole.projector_image(0, room.posed, room.viewer);
    whole.set_quick_motion(false);
    const cv::Mat expected = whole.projector_image(0, room.posed, room.viewer);
    EXPECT_EQ(cv::norm(drawing.projector_image(0, room.posed, room.viewer), expected, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(drawing.clipped(0), whole.clipped(0), cv::NORM_INF), 0);
  };
  for (const char* finish : {"", "dark"}) {
    room.posed.finish = finish;
    room.posed.drawn = {drawn_line("a", -0.2, -0.1, 0.05)};
    expect_same("the first line");
    for (const double to : {-0.08, 0.0, 0.05, 0.15}) {
      room.posed.drawn[0] = drawn_line("a", -0.2, to, 0.05);
      expect_same("a line grows");
    }
    for (const double y : {-0.05, -0.1}) {
      room.posed.drawn.push_back(drawn_line("b", -0.1, 0.1, y));  // two curves of one name, as outlines have
      expect_same("a curve comes");
    }
    room.posed.drawn[1].curve.points[20].p.y() += 0.01;
    expect_same("a point moves");
    room.posed.drawn[0].style.colour = {1, 0, 0};
    expect_same("another colour");
    room.posed.drawn[2].curve.is_closed = true;
    expect_same("a closed curve");
    room.posed.drawn[0] = drawn_line("a", -0.2, 0.15, 0.05, 0.03);
    expect_same("another course");
    room.posed.drawn.pop_back();
    expect_same("a curve goes");
    room.posed.drawn[1] = drawn_line("b", 3, 3.2, 0.05);
    expect_same("a line beside the image");
    room.posed.drawn.clear();
    expect_same("all lines go");
  }
}

TEST_F(LinesTest, AGrowingLineChangesASmallPartOfTheImage) {
  JudgedRoom room = room_of({});
  const Imager& projector = room.rig.projectors[0];
  scene::PosedScene before = room.posed, now = room.posed;
  before.drawn = {drawn_line("a", -0.2, 0, 0.05)};
  now.drawn = {drawn_line("a", -0.2, 0.02, 0.05)};
  const auto boxes = changed_lines(before, now);
  ASSERT_TRUE(boxes);
  const auto rect = rect_around(*boxes, *room.posed.world_from_prototype, projector);
  ASSERT_TRUE(rect);
  EXPECT_GT(rect->area(), 0);
  EXPECT_LT(rect->area(), projector.width * projector.height / 100);
  now.drawn = before.drawn;
  EXPECT_EQ(rect_around(changed_lines(before, now).value(), *room.posed.world_from_prototype, projector),
            cv::Rect());
  now.finish = "dark";
  EXPECT_FALSE(changed_lines(before, now)) << "not only lines";
}

struct Seen {
  std::vector<double> errors_mm;
  double share_within(double mm) const {
    return errors_mm.empty() ? 0
                             : static_cast<double>(std::count_if(errors_mm.begin(), errors_mm.end(),
                                                                 [&](double e) { return e <= mm; })) /
                                   static_cast<double>(errors_mm.size());
  }
};

// The error of a line's middle in each row (or column) of the camera's image: of the centre of the light
// within 6 mm of where the line should be. `at` of a point is its distance from there (m), with a sign.
Seen seen_lines(const JudgedRoom& room, const cv::Mat& shown, int axis, double spacing_m) {
  sim::World world = room.world;
  world.camera_effects = {{.colour = true}};
  world.projector_effects = {{.gamma = 2.2}};
  const sim::Samples samples = sim::trace(world, 0);
  const std::vector<cv::Mat> images = {shown};
  const cv::Mat seen = sim::ideal_light(world, samples, images);
  struct Sum {
    double light = 0, moment = 0;
  };
  std::map<std::pair<int, int>, Sum> sums;  // by row or column of the image, and line
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (samples.object[k] != 0 || samples.weight[k] < 1) continue;
    const Eigen::Vector3f& p = samples.p_world[k];
    if (std::abs(p.x()) > 0.19F || std::abs(p.y()) > 0.14F) continue;
    const int row = samples.pixel[k] / samples.width, column = samples.pixel[k] % samples.width;
    const double line = std::round(p[axis] / spacing_m), off = p[axis] - spacing_m * line;
    if (std::abs(off) > 0.006) continue;
    const double light = seen.at<cv::Vec3f>(row, column)[1];
    Sum& sum = sums[{axis == 0 ? row : column, static_cast<int>(line)}];
    sum.light += light;
    sum.moment += light * off;
  }
  double most = 0;
  for (const auto& [place, sum] : sums) most = std::max(most, sum.light);
  Seen out;
  for (const auto& [place, sum] : sums)
    if (sum.light > 0.3 * most) out.errors_mm.push_back(1e3 * std::abs(sum.moment / sum.light));
  return out;
}

// The camera's pixels see 1.3 mm of the panel, the projector's light as much.
TEST_F(LinesTest, ThinLinesAreSeenWhereTheyShouldBe) {
  const Mesh mesh = bowed_panel(60);
  JudgedRoom room =
      room_of({repeated("sections", scene::RepeatedLines::Form::stripes, 0.04, 0.7e-3),
               curve(mesh, "curve", across(0.05), 0.7e-3), curve(mesh, "curve 2", across(-0.05), 0.7e-3)});
  Renderer drawing = renderer(room.scene, room.rig);
  for (const bool is_curve : {false, true}) {
    room.posed.lines =
        is_curve ? std::vector<std::string>{"curve", "curve 2"} : std::vector<std::string>{"sections"};
    const cv::Mat shown = drawing.projector_image(0, room.posed, room.viewer);
    const Seen seen = is_curve ? seen_lines(room, shown, 1, 0.05) : seen_lines(room, shown, 0, 0.04);
    ASSERT_GT(seen.errors_mm.size(), 400U);
    double sum = 0;
    for (const double e : seen.errors_mm) sum += e;
    fmt::print("{}: {} places, mean {:.3f} mm, {:.2f} % within 0.3 mm\n", is_curve ? "curves" : "sections",
               seen.errors_mm.size(), sum / static_cast<double>(seen.errors_mm.size()),
               100 * seen.share_within(0.3));
    EXPECT_GE(seen.share_within(0.3), 0.95);
  }
}

}  // namespace
}  // namespace limn::projector
