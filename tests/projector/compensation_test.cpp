// Parts on a printed, curved prototype in a room with light. The ray tracer makes the photographs, and its
// images are the reference.
#include "projector/compensation.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "calib/response/measure_response.h"
#include "core/image_io.h"
#include "projector/renderer.h"
#include "sim/sensor_model.h"
#include "tests/calib/response_captures.h"
#include "tests/projector/gl_test.h"
#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

using Eigen::Vector3d;

constexpr double k_width = 0.5, k_height = 0.36, k_bulge = 0.06;  // m

// A sheet that bulges towards the devices (-z); the uvs cover all of it.
std::shared_ptr<scene::Mesh> bulged(double towards_m = 0) {
  constexpr int k_cells = 48;
  auto mesh = std::make_shared<scene::Mesh>();
  const auto at = [&](double u, double v) {
    const double z =
        -k_bulge * std::cos(std::numbers::pi * (u - 0.5)) * std::cos(std::numbers::pi * (v - 0.5));
    return Vector3d((u - 0.5) * k_width, (v - 0.5) * k_height, z - towards_m);
  };
  for (int r = 0; r <= k_cells; ++r)
    for (int c = 0; c <= k_cells; ++c) {
      const double u = 1.0 * c / k_cells, v = 1.0 * r / k_cells, e = 1e-4;
      const Vector3d n = (at(u, v + e) - at(u, v - e)).cross(at(u + e, v) - at(u - e, v)).normalized();
      mesh->positions.push_back(at(u, v).cast<float>());
      mesh->normals.push_back(n.cast<float>());
      mesh->uvs.emplace_back(static_cast<float>(u), static_cast<float>(1 - v));
    }
  const auto index = [&](int c, int r) { return static_cast<std::uint32_t>(r * (k_cells + 1) + c); };
  for (int r = 0; r < k_cells; ++r)
    for (int c = 0; c < k_cells; ++c) {
      mesh->triangles.push_back({index(c, r), index(c, r + 1), index(c + 1, r)});
      mesh->triangles.push_back({index(c + 1, r), index(c, r + 1), index(c + 1, r + 1)});
    }
  mesh->triangle_materials.assign(mesh->triangles.size(), 0);
  return mesh;
}

// The print on the prototype: coloured stripes and discs on a light ground.
cv::Mat print() {
  cv::Mat image(360, 500, CV_8UC3, cv::Scalar(215, 222, 226));
  for (int i = 0; i < 5; ++i)
    cv::rectangle(image, cv::Rect(20 + 100 * i, 30, 60, 300),
                  cv::Scalar(170 + 12 * (i % 3), 200 - 14 * i, 150 + 17 * i), cv::FILLED, cv::LINE_AA);
  cv::circle(image, {150, 180}, 70, cv::Scalar(205, 170, 160), cv::FILLED, cv::LINE_AA);
  cv::circle(image, {350, 180}, 70, cv::Scalar(150, 190, 215), cv::FILLED, cv::LINE_AA);
  return image;
}

// The image that designers want to see there: soft colours and letters.
cv::Mat paint() {
  cv::Mat image(360, 500, CV_8UC3);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(static_cast<uchar>(190 + 45 * std::sin(x / 80.0)),
                                            static_cast<uchar>(190 + 45 * std::sin(y / 60.0 + 1)),
                                            static_cast<uchar>(190 + 45 * std::cos((x + y) / 90.0)));
  cv::putText(image, "LIMN", {60, 230}, cv::FONT_HERSHEY_DUPLEX, 4, cv::Scalar(235, 190, 170), 14,
              cv::LINE_AA);
  return image;
}

sim::World printed_world() {
  sim::World world = test::small_world();
  world.rig.cameras[0] = {"camera0", 640, 480, Lens::pinhole(900, 900, 319.5, 239.5),
                          looking_at({0.03, 0.02, 0.05}, {0, 1, 0}, Vector3d::UnitZ())};
  const auto projector = [](const char* name, const Vector3d& p_viewpoint, double fx) {
    return Imager{name, 640, 400,
                  Lens::create("LENSMODEL_OPENCV4", {fx, fx, 320, 205, -0.05, 0.01, 1e-4, 2e-4}).value(),
                  looking_at(p_viewpoint, {0, 1, 0}, Vector3d::UnitZ())};
  };
  world.rig.projectors = {projector("projector0", {-0.4, -0.05, 0.12}, 1000),
                          projector("projector1", {0.35, 0.1, 0.05}, 900)};
  world.camera_effects[0] = {.colour = true,
                             .exposure = 0.5,
                             .psf_px = 0.5,
                             .full_well_e = 12000,
                             .read_noise = 0.5,
                             .black_level = 4};
  world.camera_effects[0].sensitivity << 0.9, 0.08, 0, 0.05, 0.88, 0.07, 0.01, 0.09, 0.9;
  world.projector_effects.assign(
      2, {.illuminance_at_1m = 1.3, .gamma = 2.2, .black_level = 0.004, .vignetting = 0.15});
  world.projector_effects[1].illuminance_at_1m = 1.1;
  world.objects.clear();
  sim::Object prototype;
  prototype.name = "prototype";
  prototype.mesh = bulged();
  prototype.world_from_object = test::facing_minus_y(0, 1, 0);
  prototype.prototype_from_object = Pose();
  prototype.texture = print();
  prototype.albedo.setConstant(0.9);
  world.objects.push_back(prototype);
  world.world_from_prototype = prototype.world_from_object;
  world.room.ambient = 0.08;
  world.seed = test::test_rng()();
  return world;
}

scene::Scene painted_scene(const cv::Mat& paint) {
  scene::Scene scene;
  scene.prototype = scene::Prototype{*bulged(), {}, 0.9, print()};
  scene::Slot slot;
  slot.name = "paint";
  slot.mode = scene::Mode::surface;
  scene::Mesh mesh = *bulged(0.0003);
  mesh.materials[0].base_colour = {1, 1, 1};
  mesh.materials[0].unlit = true;
  mesh.materials[0].texture = paint;
  slot.variants.push_back({"a", mesh});
  scene.slots.push_back(slot);
  return scene;
}

// sRGB values (0 to 1) of light relative to `white` (BGR).
cv::Mat encoded(const cv::Mat& light, const cv::Scalar& white) {
  cv::Mat out = light.clone();
  for (auto& pixel : cv::Mat_<cv::Vec3f>(out))
    for (int c = 0; c < 3; ++c)
      pixel[c] = static_cast<float>(srgb_from_linear(std::clamp(pixel[c] / white[c], 0.0, 1.0)));
  return out;
}

double psnr(const cv::Mat& a, const cv::Mat& b, const cv::Mat& where) {
  const double rms = cv::norm(a, b, cv::NORM_L2, where) / std::sqrt(3.0 * cv::countNonZero(where));
  return -20 * std::log10(rms);
}

// Structural similarity with a Gaussian window of 1.5 px (Wang et al. 2004), mean over `where`.
double ssim(const cv::Mat& a, const cv::Mat& b, const cv::Mat& where) {
  constexpr double k_c1 = 0.01 * 0.01, k_c2 = 0.03 * 0.03;
  const auto mean = [](const cv::Mat& m) {
    cv::Mat out;
    cv::GaussianBlur(m, out, {11, 11}, 1.5);
    return out;
  };
  const cv::Mat ma = mean(a), mb = mean(b);
  const cv::Mat va = mean(a.mul(a)) - ma.mul(ma), vb = mean(b.mul(b)) - mb.mul(mb),
                vab = mean(a.mul(b)) - ma.mul(mb);
  cv::Mat above = (2 * ma.mul(mb) + cv::Scalar::all(k_c1)).mul(2 * vab + cv::Scalar::all(k_c2));
  cv::Mat below = (ma.mul(ma) + mb.mul(mb) + cv::Scalar::all(k_c1)).mul(va + vb + cv::Scalar::all(k_c2));
  const cv::Scalar s = cv::mean(above / below, where);
  return (s[0] + s[1] + s[2]) / 3;
}

class CompensationTest : public test::GlTest {};

// The rig with the true responses.
Rig true_rig(const sim::World& world) {
  Rig rig = world.rig;
  for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
    const sim::ProjectorEffects& effects = world.projector_effects[i];
    ProjectorResponse response{rig.projectors[i].name, {}, {}, {}};
    std::vector<double>* curves[] = {&response.blue, &response.green, &response.red};
    for (int c = 0; c < 3; ++c)
      for (int v = 0; v < 256; ++v) curves[c]->push_back(sim::light_share(effects, c, v / 255.0));
    response.black_level = Measurement{effects.black_level, 0};
    response.vignetting = Vignetting{Eigen::Vector2d::Zero(), -effects.vignetting, 0, 0};
    rig.responses.push_back(response);
  }
  return rig;
}

// Light of the prototype in the camera, without noise; NaN beside it and at its edges. `shown` holds the
// projectors' images.
cv::Mat light_on_prototype(const sim::World& world, const std::vector<cv::Mat>& shown) {
  const sim::Samples samples = sim::trace(world, 0);
  const cv::Mat light = sim::ideal_light(world, samples, shown);
  cv::Mat beside(light.size(), CV_8U, cv::Scalar(255));
  for (std::size_t k = 0; k < samples.size(); ++k)
    if (samples.object[k] == 0)
      beside.at<uchar>(samples.pixel[k] / light.cols, samples.pixel[k] % light.cols) = 0;
  cv::dilate(beside, beside, cv::Mat(), {-1, -1}, 6);
  cv::Mat green;
  cv::extractChannel(light, green, 1);
  green.setTo(std::numeric_limits<float>::quiet_NaN(), beside);
  return green;
}

// A quantile: the value below which this share of an image's numbers lies.
double at_share(const cv::Mat& image, double share) {
  std::vector<float> values;
  for (const float value : cv::Mat_<float>(image))
    if (!std::isnan(value)) values.push_back(value);
  std::sort(values.begin(), values.end());
  return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

// The largest change of light within 4 pixels along rows or columns (99.9 % quantile), after a blur: people
// do not resolve the projectors' pixels.
double largest_step(const cv::Mat& image) {
  cv::Mat light;
  cv::GaussianBlur(image, light, {7, 7}, 1);
  constexpr int k_apart = 4;
  cv::Mat steps(light.size(), CV_32F, cv::Scalar(std::numeric_limits<float>::quiet_NaN()));
  for (int row = k_apart; row < light.rows; ++row)
    for (int column = k_apart; column < light.cols; ++column)
      steps.at<float>(row, column) =
          std::max(std::abs(light.at<float>(row, column) - light.at<float>(row - k_apart, column)),
                   std::abs(light.at<float>(row, column) - light.at<float>(row, column - k_apart)));
  return at_share(steps, 0.999);
}

// A prototype of uniform albedo, and two equal projectors whose images end on it.
sim::World bare_world() {
  sim::World world = printed_world();
  world.objects[0].texture = cv::Mat();
  world.room.ambient = 0;
  world.projector_effects[1].illuminance_at_1m = world.projector_effects[0].illuminance_at_1m;
  world.rig.projectors[0].imager_from_world =
      looking_at({-0.4, -0.05, 0.12}, {-0.16, 1, 0}, Vector3d::UnitZ());
  world.rig.projectors[1].imager_from_world = looking_at({0.35, 0.1, 0.05}, {0.16, 1, 0}, Vector3d::UnitZ());
  for (Imager& projector : world.rig.projectors) projector.lens = Lens::pinhole(950, 950, 319.5, 199.5);
  return world;
}

TEST_F(CompensationTest, OneColourIsEvenAcrossTwoProjectors) {
  const sim::World world = bare_world();
  const Rig rig = true_rig(world);
  const cv::Mat white(16, 16, CV_8UC3, cv::Scalar::all(255));
  scene::Scene scene = painted_scene(white);
  scene.prototype->albedo_image = cv::Mat();
  scene::PosedScene posed;
  posed.world_from_prototype = world.world_from_prototype;
  posed.parts.push_back({"paint", "a", world.world_from_prototype});
  auto made = Renderer::create(scene, rig);
  ASSERT_TRUE(made.ok()) << made.message();
  const auto shone = [&](const LightOptions& options) {
    EXPECT_TRUE(made->set_light(options).ok());
    std::vector<cv::Mat> images;
    for (std::size_t i = 0; i < 2; ++i) images.push_back(made->projector_image(i, posed, rig.cameras[0]));
    const cv::Mat light = light_on_prototype(world, images);
    return (at_share(light, 0.995) - at_share(light, 0.005)) / at_share(light, 0.5);
  };
  // Bright enough that one 8-bit step is less than half a percent, and dim enough to be reached everywhere.
  const double with = shone({.compensation = Compensation::geometry, .level = 0.45});
  const double without = shone({});
  fmt::print("99 % of the light within {:.4f} of its mean, without compensation {:.4f}\n", with, without);
  EXPECT_LT(with, 0.04);
  EXPECT_GT(without, 0.2);
}

TEST_F(CompensationTest, BlackIsEvenAcrossTwoProjectors) {
  sim::World world = bare_world();
  for (sim::ProjectorEffects& effects : world.projector_effects) effects.black_level = 0.01;
  const Rig rig = true_rig(world);
  scene::Scene scene = painted_scene(print());
  scene::PosedScene posed;
  posed.world_from_prototype = world.world_from_prototype;
  auto made = Renderer::create(scene, rig);
  ASSERT_TRUE(made.ok()) << made.message();
  const auto shone = [&](bool even) {
    EXPECT_TRUE(made->set_light({.even_black = even}).ok());
    std::vector<cv::Mat> images;
    for (std::size_t i = 0; i < 2; ++i) images.push_back(made->projector_image(i, posed, rig.cameras[0]));
    return light_on_prototype(world, images);
  };
  const cv::Mat uneven = shone(false), even = shone(true);
  const double one = at_share(uneven, 0.02);  // where only one projector's black level is visible
  fmt::print("black: steps of {:.3f} of one projector's, {:.3f} without\n", largest_step(even) / one,
             largest_step(uneven) / one);
  EXPECT_GT(largest_step(uneven), 0.5 * one);
  EXPECT_LT(largest_step(even), 0.1 * one);
}

struct Judged {
  double psnr_db, ssim;  // where projected light can give the wanted colour
  double psnr_without_db;
  double in_gamut_share;
};

// The surface is measured in one pose and the part is projected in another.
Judged painted_over_print(const Pose& new_from_old) {
  sim::World world = printed_world();
  const scene::Scene scene = painted_scene(paint());
  const auto measured = calib::measure_response(calib::captured(world));
  if (!measured) throw std::runtime_error(measured.message());
  Rig rig = world.rig;
  rig.responses = measured->responses.projectors;
  rig.camera_responses = measured->responses.cameras;
  auto made = Renderer::create(scene, rig);
  if (!made) throw std::runtime_error(made.message());
  Renderer renderer = std::move(made).value();
  const MeasuredSurface surface{rig.cameras[0], world.world_from_prototype, measured->mixings};
  sim::move_prototype(world, new_from_old * world.world_from_prototype);
  scene::PosedScene posed;
  posed.world_from_prototype = world.world_from_prototype;
  posed.parts.push_back({"paint", "a", world.world_from_prototype});

  // The wanted result: a prototype with these colours.
  sim::World wanted_world = world;
  wanted_world.objects[0].texture = paint();
  const sim::Samples samples = sim::trace(world, 0), wanted_samples = sim::trace(wanted_world, 0);
  const cv::Size size(rig.cameras[0].width, rig.cameras[0].height);
  cv::Mat wanted(size, CV_32FC3, cv::Scalar::all(0)), on_prototype(size, CV_8U, cv::Scalar(0));
  for (std::size_t k = 0; k < wanted_samples.size(); ++k) {
    const int row = wanted_samples.pixel[k] / size.width, column = wanted_samples.pixel[k] % size.width;
    const Eigen::Vector3f bgr = wanted_samples.weight[k] * wanted_samples.albedo[k] / 0.9F;
    wanted.at<cv::Vec3f>(row, column) += cv::Vec3f(bgr.x(), bgr.y(), bgr.z());
    if (wanted_samples.object[k] == 0) on_prototype.at<uchar>(row, column) = 255;
  }
  cv::erode(on_prototype, on_prototype, cv::Mat(), {-1, -1}, 6);

  const auto shone = [&](const LightOptions& options, cv::Mat* in_gamut) {
    const Status status = renderer.set_light(options, &surface);
    EXPECT_TRUE(status.ok()) << status.message();
    std::vector<cv::Mat> images;
    *in_gamut = on_prototype.clone();
    for (std::size_t i = 0; i < rig.projectors.size(); ++i) {
      images.push_back(renderer.projector_image(i, posed, rig.cameras[0]));
      cv::Mat clipped;
      cv::dilate(renderer.clipped(i), clipped, cv::Mat(), {-1, -1}, 2);
      for (std::size_t k = 0; k < samples.size(); ++k) {
        const sim::ProjectorView& view = samples.projectors[i][k];
        const cv::Point px(cvRound(view.u), cvRound(view.v));
        if (view.gain > 0 && cv::Rect({}, clipped.size()).contains(px) && clipped.at<uchar>(px) != 0)
          in_gamut->at<uchar>(samples.pixel[k] / size.width, samples.pixel[k] % size.width) = 0;
      }
    }
    return cv::Mat(sim::ideal_light(world, samples, images));
  };
  // Each channel is scaled for the best fit, because the camera's white is not under test.
  const auto judge = [&](const cv::Mat& light, const cv::Mat& where, double* similarity) {
    std::vector<cv::Mat> seen, ideal;
    cv::split(light, seen);
    cv::split(wanted, ideal);
    cv::Scalar gain;
    for (std::size_t c = 0; c < 3; ++c) {
      cv::Mat weight;
      where.convertTo(weight, CV_32F, 1 / 255.0);
      gain[static_cast<int>(c)] = seen[c].mul(weight).dot(ideal[c]) / ideal[c].mul(weight).dot(ideal[c]);
    }
    const cv::Mat a = encoded(light, gain), b = encoded(wanted, {1, 1, 1});
    *similarity = ssim(a, b, where);
    return psnr(a, b, where);
  };
  cv::Mat in_gamut, everywhere;
  const cv::Mat with = shone({.compensation = Compensation::measured}, &in_gamut);
  const cv::Mat without = shone({}, &everywhere);
  Judged judged_as{};
  double ignored = 0;
  judged_as.psnr_db = judge(with, in_gamut, &judged_as.ssim);
  judged_as.psnr_without_db = judge(without, in_gamut, &ignored);
  judged_as.in_gamut_share = 1.0 * cv::countNonZero(in_gamut) / cv::countNonZero(on_prototype);
  fmt::print(
      "{:.3f} of the prototype in gamut: {:.1f} dB, SSIM {:.3f}; without {:.1f} dB; {} captures a "
      "projector\n",
      judged_as.in_gamut_share, judged_as.psnr_db, judged_as.ssim, judged_as.psnr_without_db,
      measured->responses.projectors[0].captures);
  return judged_as;
}

TEST_F(CompensationTest, PaintsOverAPrintInALitRoom) {
  const Judged judged = painted_over_print(Pose());
  EXPECT_GT(judged.in_gamut_share, 0.6);
  EXPECT_GT(judged.psnr_db, 30);
  EXPECT_GT(judged.ssim, 0.93);
  EXPECT_GT(judged.psnr_db, judged.psnr_without_db + 8);
}

TEST_F(CompensationTest, WhatWasMeasuredMovesWithThePrototype) {
  const Pose about_the_middle(exp_rotation({0.03, -0.05, 0.12}), {0.03, 0, -0.02});
  const Pose to_middle(Eigen::Quaterniond::Identity(), {0, -1, 0});
  const Judged judged = painted_over_print(to_middle.inverse() * about_the_middle * to_middle);
  EXPECT_GT(judged.in_gamut_share, 0.6);
  EXPECT_GT(judged.psnr_db, 30);
  EXPECT_GT(judged.ssim, 0.93);
}

}  // namespace
}  // namespace limn::projector
