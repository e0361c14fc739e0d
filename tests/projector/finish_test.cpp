// A finish of the whole prototype, against the ray tracer.
#include <cmath>
#include <memory>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "core/scale_resolution.h"
#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "tests/projector/bowed_panel.h"
#include "tests/projector/judged_image.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using FinishTest = RendererTest;

// Soft stripes; with alpha they fade to nothing towards the image's sides.
cv::Mat stripes(bool with_alpha) {
  constexpr int k_texels = 48;
  cv::Mat image(k_texels, k_texels, with_alpha ? CV_8UC4 : CV_8UC3);
  for (int row = 0; row < k_texels; ++row)
    for (int column = 0; column < k_texels; ++column) {
      const double wave = 0.5 + 0.5 * std::sin(4 * M_PI * (column + 0.5) / k_texels);
      const double fade =
          std::sin(M_PI * (row + 0.5) / k_texels) * std::sin(M_PI * (column + 0.5) / k_texels);
      const auto level = [](double share) { return cv::saturate_cast<std::uint8_t>(255 * share); };
      if (with_alpha)
        image.at<cv::Vec4b>(row, column) = {level(0.2), level(wave), level(0.9), level(fade)};
      else
        image.at<cv::Vec3b>(row, column) = {level(0.3 + 0.5 * wave), level(0.6), level(0.8 - 0.5 * wave)};
    }
  return image;
}

std::vector<scene::Finish> finishes() {
  scene::Finish lacquer, decal, cloth;
  lacquer.name = "lacquer";
  lacquer.base_colour = {0.5, 0.06, 0.04};
  lacquer.metallic = 0.5;
  lacquer.roughness = 0.5;
  lacquer.clearcoat = 0.9;
  lacquer.clearcoat_roughness = 0.3;
  lacquer.for_viewer = true;
  decal = lacquer;
  decal.name = "decal";
  decal.for_viewer = false;
  decal.image.emplace();
  decal.image->texture.image = stripes(true);
  decal.image->projection = scene::FinishImage::Projection();
  // Turned about the panel's normal, and looked at from -z: y is down in the room and up in the image.
  decal.image->projection->prototype_from_image =
      Pose(exp_rotation({0, 0, 0.4}) * exp_rotation({M_PI, 0, 0}), {0.03, -0.02, 0});
  decal.image->projection->size_m = {0.3, 0.2};
  cloth.name = "cloth";
  cloth.image.emplace();
  cloth.image->texture.image = stripes(false);
  cloth.image->repeats = true;
  return {lacquer, decal, cloth};
}

// The room's light, with or without a lamp of its own, and two parts on the panel.
JudgedRoom room_with(bool has_light) {
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  EXPECT_TRUE(scale_resolution(0.5, &rig));
  Mesh badge = coloured(sheet(0.08, 0.08, -0.0003), {0.1F, 0.2F, 0.7F}, false),
       knob = sheet(0.06, 0.06, -0.06);
  knob.materials[0].base_colour = {0.2F, 0.6F, 0.2F};
  Scene scene = scene_of(bowed_panel(40),
                         {slot("badge", scene::Mode::surface, badge), slot("knob", scene::Mode::view, knob)});
  scene.finishes = finishes();
  if (has_light)
    scene.light = scene::RoomLight{k_up,
                                   {0.05, 0.08, 0.1},
                                   {0.3, 0.28, 0.25},
                                   {{Vector3d(0.2, -0.5, -1).normalized(), {0.5, 0.45, 0.4}}}};
  JudgedRoom room = judged_room(std::move(rig), std::move(scene));
  room.posed.parts[1].world_from_part.translation = {0.12, 0.06, 0};
  return room;
}

TEST_F(FinishTest, LightAndCompositesAreThoseOfTheRayTracer) {
  for (const bool has_light : {true, false}) {
    JudgedRoom room = room_with(has_light);
    Renderer drawing = renderer(room.scene, room.rig);
    for (const scene::Finish& finish : room.scene.finishes) {
      if (!has_light && finish.is_diffuse()) continue;  // as in a room's light
      SCOPED_TRACE(finish.name + (has_light ? " in a room's light" : " without a room's light"));
      room.posed.finish = finish.name;
      expect_agreement(&drawing, room, 20000, 15000);
    }
  }
}

TEST_F(FinishTest, ComesAndGoesAndLeavesTheScreenToTheLight) {
  JudgedRoom room = room_with(true);
  Renderer drawing = renderer(room.scene, room.rig);
  const cv::Mat grey(240, 320, CV_8UC3, cv::Scalar::all(90));
  const auto light = [&] { return drawing.projector_image(0, room.posed, room.viewer); };
  const auto screen = [&](Composite what) { return drawing.composite(0, grey, room.posed, what); };
  const cv::Mat bare_light = light(), bare_rest = screen(Composite::rest),
                bare_full = screen(Composite::full);
  room.posed.finish = "lacquer";
  EXPECT_GT(cv::countNonZero(light().reshape(1)), 4 * cv::countNonZero(bare_light.reshape(1)));
  // The screen adds what the projector does not reach: here nothing but the panel's rim.
  int added = 0;
  const cv::Mat rest = screen(Composite::rest);
  for (int row = 0; row < rest.rows; ++row)
    for (int column = 0; column < rest.cols; ++column)
      added += rest.at<cv::Vec3b>(row, column) != bare_rest.at<cv::Vec3b>(row, column);
  EXPECT_LT(added, 1500);
  EXPECT_GT(cv::norm(screen(Composite::full), bare_full, cv::NORM_INF), 30);
  room.posed.finish = "cloth";
  EXPECT_GT(cv::norm(screen(Composite::full), bare_full, cv::NORM_INF), 30);
  room.posed.finish = "";
  EXPECT_EQ(cv::norm(light(), bare_light, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(screen(Composite::full), bare_full, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(screen(Composite::rest), bare_rest, cv::NORM_INF), 0);
}

// The camera's pixels on the panel, without its rim.
cv::Mat inside_of_panel(const sim::Samples& samples) {
  cv::Mat inside(240, 320, CV_8U, cv::Scalar(0));
  for (std::size_t k = 0; k < samples.size(); ++k)
    if (samples.object[k] == 0) inside.at<std::uint8_t>(samples.pixel[k] / 320, samples.pixel[k] % 320) = 255;
  cv::erode(inside, inside, cv::Mat::ones(9, 9, CV_8U));
  return inside;
}

// The panel is painted in light and seen by the ray tracer: as wanted on grey clay, and on coloured clay.
TEST_F(FinishTest, IsSeenAsWantedInTheDarkAndOnColouredClay) {
  constexpr double k_level = 0.2;
  for (const bool is_coloured : {false, true}) {
    SCOPED_TRACE(is_coloured ? "coloured clay" : "grey clay");
    JudgedRoom room = room_with(true);
    room.posed.finish = "lacquer";
    room.posed.parts.clear();
    sim::Object& clay = room.world.objects[0];
    double mean_albedo = 0.8;
    if (is_coloured) {
      cv::Mat paint(32, 32, CV_8UC3);
      for (int row = 0; row < 32; ++row)
        for (int column = 0; column < 32; ++column)
          paint.at<cv::Vec3b>(row, column) = {cv::saturate_cast<std::uint8_t>(150 + 2 * row),
                                              cv::saturate_cast<std::uint8_t>(190 - column),
                                              cv::saturate_cast<std::uint8_t>(160 + 2 * column)};
      room.scene.prototype->albedo_image = paint;
      clay.texture = paint;
      clay.albedo = Vector3d::Ones();
      mean_albedo = mean_albedo_of(*room.scene.prototype);
    }
    room.world.camera_effects = {{.colour = true}};
    room.world.projector_effects = {{.gamma = 2.2}};
    Renderer drawing = renderer(room.scene, room.rig);
    ASSERT_TRUE(drawing.set_light({.compensation = Compensation::geometry, .level = k_level}));
    const sim::Samples samples = sim::trace(room.world, 0);
    const cv::Mat inside = inside_of_panel(samples);
    // What the camera sees, linear BGR, as a share of a white panel at the renderer's level.
    const std::vector<cv::Mat> shown = {drawing.projector_image(0, room.posed, room.viewer)};
    const cv::Mat seen = sim::ideal_light(room.world, samples, shown) / (k_level * mean_albedo);
    // `view`: what the viewer should see; the camera takes the viewer's place in the judge.
    const cv::Mat wanted =
        sim::ReferenceRenderer(room.world, room.posed, room.viewer).projector_image(0).light;
    ASSERT_FALSE(wanted.empty());
    double sum = 0, squares = 0;
    int count = 0, far_off = 0;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const int row = samples.pixel[k] / 320, column = samples.pixel[k] % 320;
      const sim::ProjectorView& view = samples.projectors[0][k];
      const cv::Point px(cvFloor(view.u), cvFloor(view.v));
      if (samples.weight[k] < 1 || inside.at<std::uint8_t>(row, column) == 0 || view.gain <= 0 ||
          !cv::Rect(4, 4, 312, 192).contains(px))
        continue;
      double worst = 0;
      for (int c = 0; c < 3; ++c) {
        const auto encode = [](float light) {
          return 255 * srgb_from_linear(std::clamp(static_cast<double>(light), 0.0, 1.0));
        };
        const float fx = view.u - static_cast<float>(px.x), fy = view.v - static_cast<float>(px.y);
        const auto at = [&](int dx, int dy) { return wanted.at<cv::Vec3f>(px.y + dy, px.x + dx)[c]; };
        const float between =
            (1 - fy) * ((1 - fx) * at(0, 0) + fx * at(1, 0)) + fy * ((1 - fx) * at(0, 1) + fx * at(1, 1));
        const double off = encode(seen.at<cv::Vec3f>(row, column)[c]) - encode(between);
        worst = std::max(worst, std::abs(off));
        squares += off * off / 3;
      }
      ++count;
      sum += worst;
      far_off += worst > 4;
    }
    ASSERT_GT(count, 15000);
    const double psnr_db = 10 * std::log10(255 * 255 / (squares / count));
    fmt::print("mean {:.2f} levels, {:.2f} % over 4, {:.1f} dB\n", sum / count, 100.0 * far_off / count,
               psnr_db);
    EXPECT_GT(psnr_db, 30);
    if (is_coloured) continue;
    EXPECT_LE(sum / count, 1);
    EXPECT_LE(1.0 * far_off / count, 0.005);
  }
}

}  // namespace
}  // namespace limn::projector
