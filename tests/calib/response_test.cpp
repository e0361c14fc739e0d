#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>

#include "calib/response/camera_response.h"
#include "calib/response/colour_mixing.h"
#include "calib/response/measure_response.h"
#include "calib/response/response_patterns.h"
#include "calib/response/response_shots.h"
#include "core/file.h"
#include "core/image_io.h"
#include "sim/sensor_model.h"
#include "tests/calib/response_captures.h"
#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;
using namespace test;

// A coloured, textured box in front of a wall, in a room with some light of its own; ordinary noise.
sim::World lit_world(int height = 240) {
  sim::World world = small_world(1.2);
  Imager& camera = world.rig.cameras[0];
  const double scale = height / 240.0;
  camera.height = height;
  camera.width = height * 4 / 3;
  camera.lens = Lens::pinhole(300 * scale, 300 * scale, (camera.width - 1) / 2.0, (camera.height - 1) / 2.0);
  cv::Mat texture(64, 64, CV_8UC3);
  std::mt19937_64 rng = test_rng();
  for (auto& value : cv::Mat_<cv::Vec3b>(texture))
    for (int c = 0; c < 3; ++c) value[c] = static_cast<uchar>(90 + rng() % 160);
  sim::Object box = sim::sheet("box", 0.3, 0.25, texture, facing_minus_y(0.02, 1.0, -0.02));
  box.albedo = {0.7, 0.8, 0.9};
  world.objects[0].albedo = {0.6, 0.7, 0.75};
  world.objects.push_back(box);
  world.room.ambient = 0.05;
  world.seed = rng();
  sim::CameraEffects& effects = world.camera_effects[0];
  effects = {.colour = true,
             .exposure = 0.75,
             .psf_px = 0.6,
             .vignetting = 0.1,
             .full_well_e = 10000,
             .read_noise = 0.6,
             .black_level = 4};
  effects.sensitivity << 0.9, 0.1, 0, 0.05, 0.85, 0.1, 0.02, 0.08, 0.9;
  sim::ProjectorEffects& projector = world.projector_effects[0];
  projector = {.illuminance_at_1m = 1.3, .gamma = 2.2, .black_level = 0.005, .vignetting = 0.15};
  projector.aperture_m = 0.004;
  return world;
}

// The largest difference of a measured curve from the true one, as a share of full light.
double worst_error(const ProjectorResponse& response, const sim::ProjectorEffects& truth) {
  double worst = 0;
  const std::vector<double>* curves[] = {&response.blue, &response.green, &response.red};
  for (int c = 0; c < 3; ++c)
    for (int v = 0; v < 256; ++v)
      worst = std::max(
          worst, std::abs((*curves[c])[static_cast<size_t>(v)] - sim::light_share(truth, c, v / 255.0)));
  return worst;
}

// The largest difference between the measured and the true light of a level. Both are scaled to agree at the
// lowest and the highest level of the images, because light has no zero or unit of its own.
double worst_error(const CameraResponse& response, const sim::CameraEffects& truth) {
  const auto true_light = [&](double level) {
    const double share = std::max(0.0, (level - truth.black_level) / (255 - truth.black_level));
    return truth.srgb ? linear_from_srgb(share) : share;
  };
  constexpr int k_low = 10, k_high = 245;
  const auto share = [&](auto light, int level) {
    return (light(level) - light(k_low)) / (light(k_high) - light(k_low));
  };
  const auto found = [&](int level) { return response.light[static_cast<size_t>(level)]; };
  double worst = 0;
  for (int level = k_low; level <= k_high; ++level)
    worst = std::max(worst, std::abs(share(found, level) - share(true_light, level)));
  return worst;
}

// RMS, levels, of the predicted photograph of a colour minus the photograph without noise, where light falls.
double prediction_error(const MeasuredResponse& measured, sim::World world, const cv::Vec3b& bgr) {
  sim::CameraEffects& effects = world.camera_effects[0];
  effects.full_well_e = effects.read_noise = 0;
  const sim::Samples samples = sim::trace(world, 0);
  const Imager& projector = world.rig.projectors[0];
  const auto taken = [&](const cv::Scalar& colour) {
    const cv::Mat shown[] = {cv::Mat(projector.height, projector.width, CV_8UC3, colour)};
    return cv::Mat(sim::photograph(world, samples, shown, 1).reshape(1));
  };
  const cv::Mat black = taken({0, 0, 0}), white = taken({255, 255, 255}),
                photo = taken({bgr[0] * 1.0, bgr[1] * 1.0, bgr[2] * 1.0});
  const cv::Mat predicted = predicted_photograph(measured.mixings.at(0), measured.responses.projectors.at(0),
                                                 measured.responses.cameras.at(0), bgr)
                                .reshape(1);
  double squares = 0;
  int count = 0;
  for (int r = 0; r < photo.rows; ++r)
    for (int c = 0; c < photo.cols; ++c)
      if (white.at<uchar>(r, c) - black.at<uchar>(r, c) >= 10 && photo.at<uchar>(r, c) < k_clipped) {
        squares += std::pow(predicted.at<float>(r, c) - photo.at<uchar>(r, c), 2);
        ++count;
      }
  EXPECT_GT(count, photo.rows * photo.cols / 5);
  return std::sqrt(squares / count);
}

struct Case {
  const char* name;
  double gamma, s_curve, black_level;
  bool colour, srgb;
};

class ResponseOf : public testing::TestWithParam<Case> {};

TEST_P(ResponseOf, ProjectorAndCameraIsFoundAndForetellsOtherColours) {
  const Case& a = GetParam();
  sim::World world = lit_world();
  sim::CameraEffects& camera = world.camera_effects[0];
  sim::ProjectorEffects& projector = world.projector_effects[0];
  camera.srgb = a.srgb;
  camera.colour = a.colour;
  projector.gamma = a.gamma;
  projector.channel_gamma = {1.05, 1, 0.95};
  projector.s_curve = a.s_curve;
  projector.black_level = a.black_level;
  ASSERT_LE(response_images().size(), 60U);
  const auto measured = measure_response(captured(world));
  ASSERT_TRUE(measured.ok()) << measured.message();
  EXPECT_TRUE(measured->warnings.empty()) << measured->warnings[0];
  const ProjectorResponse& found = measured->responses.projectors.at(0);
  EXPECT_LT(worst_error(found, projector), 0.01);
  ASSERT_TRUE(found.black_level.has_value());
  EXPECT_NEAR(found.black_level->value, a.black_level, 4 * found.black_level->stddev);
  EXPECT_LT(found.black_level->stddev, 5e-4);
  EXPECT_EQ(found.captures, static_cast<int>(response_images().size()));
  const CameraResponse& seen = measured->responses.cameras.at(0);
  EXPECT_EQ(seen.encoding, a.srgb ? CameraEncoding::srgb : CameraEncoding::linear);
  EXPECT_LT(worst_error(seen, camera), 0.01);
  std::mt19937_64 rng = test_rng();
  double worst = 0;
  for (int k = 0; k < 3; ++k) {
    const cv::Vec3b bgr(static_cast<uchar>(rng() % 256), static_cast<uchar>(rng() % 256),
                        static_cast<uchar>(rng() % 256));
    worst = std::max(worst, prediction_error(*measured, world, bgr));
  }
  EXPECT_LT(worst, 2);
  EXPECT_LT(measured->mixings.at(0).held_out_levels, 3) << "includes the photographs' own noise";
  fmt::print(
      "{}: curve {:.4f}, black {:.5f} +- {:.5f} of {}, camera {:.4f} ({}), colours {:.2f} levels RMS\n",
      a.name, worst_error(found, projector), found.black_level->value, found.black_level->stddev,
      a.black_level, worst_error(seen, camera), k_camera_encodings.text(seen.encoding), worst);
}

INSTANTIATE_TEST_SUITE_P(VirtualRig,
                         ResponseOf,
                         testing::Values(Case{"Gamma18Colour", 1.8, 0, 0.002, true, false},
                                         Case{"Gamma22GreySrgb", 2.2, 0, 0.005, false, true},
                                         Case{"Gamma26ColourSrgb", 2.6, 0, 0.02, true, true},
                                         Case{"SCurveGrey", 2.2, 0.6, 0.01, false, false}),
                         [](const auto& info) { return std::string(info.param.name); });

// Samples of pixels with random light in the four shares, encoded by `level_of`, with noise.
ResponseSamples made_samples(const std::function<double(double)>& level_of, double resolved = 0) {
  std::mt19937_64 rng = test_rng();
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> noise(0, 0.8);
  ResponseSamples samples{0, 0, 4000, {}};
  for (size_t k = 0; k < samples.count; ++k) {
    const double brightness = 0.2 + 0.75 * uniform(rng);
    std::array<double, 4> share{};
    double sum = 0;
    for (double& s : share) sum += s = uniform(rng);
    for (double& s : share) s *= (1 - resolved) / sum;
    share[rng() % 4] += resolved;
    for (const ResponseImage& image : response_images()) {
      double light = 0;
      for (size_t i = 0; i < 4; ++i)
        if (image.shares >> i & 1) light += share[i] * std::pow(image.bgr[1] / 255.0, 2.2);
      const double level = level_of(0.02 + brightness * light) + noise(rng);
      samples.levels.push_back(cv::saturate_cast<uchar>(level));
    }
  }
  return samples;
}

CameraResponse encoding_of(const ResponseSamples& samples) {
  const ResponseSamples* sets[] = {&samples};
  return fitted_encoding(sets);
}

TEST(CameraResponse, PowersAndUnknownCurvesAreFound) {
  const auto worst = [](const CameraResponse& response, const std::function<double(double)>& level_of) {
    double low = 0, high = 0, worst = 0;  // the same scale at both ends of the observed range
    const auto found = [&](double light) { return lookup(response.light, level_of(light) / 255); };
    low = found(0.05), high = found(0.9);
    for (double light = 0.05; light < 0.9; light += 0.01)
      worst = std::max(worst, std::abs((found(light) - low) / (high - low) - (light - 0.05) / 0.85));
    return worst;
  };
  const auto power = [](double light) { return 3 + 252 * std::pow(light, 1 / 1.6); };
  const CameraResponse gamma = encoding_of(made_samples(power));
  EXPECT_EQ(gamma.encoding, CameraEncoding::gamma);
  EXPECT_NEAR(gamma.gamma, 1.6, 0.03);
  EXPECT_LT(worst(gamma, power), 0.01);
  // A knee: linear up to 0.6, then a quarter as steep.
  const auto knee = [](double light) {
    return 10 + 300 * (light < 0.6 ? light : 0.6 + 0.25 * (light - 0.6));
  };
  const CameraResponse measured = encoding_of(made_samples(knee));
  EXPECT_EQ(measured.encoding, CameraEncoding::measured);
  EXPECT_LT(worst(measured, knee), 0.03) << "a kink between two of the curve's knots, 26 levels apart";
  EXPECT_GT(worst(encoding_of(made_samples([](double light) { return 4 + 240 * light; })), knee), 0.1)
      << "the error if the camera were linear";
}

TEST(CameraResponse, WhatTheImagesDoNotTellIsCalledUnknown) {
  const auto linear = [](double light) { return 4 + 240 * light; };
  EXPECT_EQ(encoding_of(made_samples(linear)).encoding, CameraEncoding::linear);
  EXPECT_EQ(encoding_of(made_samples(linear, 1)).encoding, CameraEncoding::unknown)
      << "each pixel sees one share alone";
  ResponseSamples unsound = made_samples(linear);
  const size_t count = response_images().size();
  for (size_t k = 0; k < unsound.count; ++k)  // sharpened: single shares are too bright
    for (size_t i = 0; i < count; ++i)
      if (response_images()[i].role == ResponseImage::Role::share && (k + i) % 3 == 0)
        unsound.levels[k * count + i] = static_cast<uchar>(std::min(250, unsound.levels[k * count + i] + 30));
  EXPECT_EQ(encoding_of(unsound).encoding, CameraEncoding::unknown);
}

// A small capture that tests may damage.
class DamagedResponse : public testing::Test {
 protected:
  static sim::World small() {
    sim::World world = lit_world(120);
    world.rig.cameras.push_back(world.rig.cameras[0]);  // a second camera that faces away
    world.rig.cameras[1].name = "camera1";
    world.rig.cameras[1].imager_from_world = looking_at({0, 0, 0}, {0, -1, 0}, Eigen::Vector3d::UnitZ());
    world.camera_effects.push_back(world.camera_effects[0]);
    return world;
  }
  CaptureSet plan_ = captured(small());
  fs::path folder_ = plan_.folder / "response" / "projector0" / "camera0";

  std::string failure() const {
    const auto measured = measure_response(plan_);
    EXPECT_FALSE(measured.ok());
    return measured.ok() ? "" : measured.message();
  }
  void change(const char* image, const std::function<void(cv::Mat&)>& how) const {
    cv::Mat shot = read_image(folder_ / image).value();
    how(shot);
    ASSERT_TRUE(write_png(folder_ / image, shot).ok());
  }
};

TEST_F(DamagedResponse, IsNamedWithItsImage) {
  const auto whole = measure_response(plan_);
  ASSERT_TRUE(whole.ok()) << whole.message();
  ASSERT_EQ(whole->warnings.size(), 1U) << "a warning says that camera1 sees nothing";
  EXPECT_NE(whole->warnings[0].find("camera1"), std::string::npos);
  EXPECT_EQ(whole->mixings.size(), 1U);

  const fs::path shot = folder_ / "017.png";
  const std::string content = read_file(shot).value();
  fs::remove(shot);
  EXPECT_NE(failure().find("camera0/017.png: missing"), std::string::npos);
  ASSERT_TRUE(write_file(shot, content.substr(0, content.size() / 2)).ok());
  EXPECT_NE(failure().find("camera0/017.png"), std::string::npos);
  ASSERT_TRUE(write_png(shot, cv::Mat(50, 60, CV_8UC3, cv::Scalar::all(9))).ok());
  EXPECT_NE(failure().find("found 60x50"), std::string::npos);
  ASSERT_TRUE(write_png(shot, cv::Mat(120, 160, CV_8U, cv::Scalar(9))).ok());
  EXPECT_NE(failure().find("found grey"), std::string::npos);
  ASSERT_TRUE(write_file(shot, read_file(folder_ / "015.png").value()).ok());  // the projector skipped one
  EXPECT_NE(failure().find("repeated, lost"), std::string::npos);
  ASSERT_TRUE(write_file(shot, content).ok());

  ASSERT_TRUE(write_file(folder_ / "057.png", content).ok());
  EXPECT_NE(failure().find("057.png"), std::string::npos);
  fs::remove(folder_ / "057.png");
  fs::create_directories(plan_.folder / "response" / "projektor0");
  EXPECT_NE(failure().find("projektor0"), std::string::npos);
  fs::remove(plan_.folder / "response" / "projektor0");
  EXPECT_TRUE(measure_response(plan_).ok()) << "everything is restored";
}

TEST_F(DamagedResponse, DarkAndSaturatedAreToldApart) {
  fs::remove_all(plan_.folder / "response" / "projector0" / "camera1");
  const auto all = [&](const std::function<void(cv::Mat&)>& how) {
    for (size_t i = 0; i < response_images().size(); ++i) change(fmt::format("{:03d}.png", i).c_str(), how);
  };
  all([](cv::Mat& shot) { shot = shot * 0.02; });
  EXPECT_NE(failure().find("dark"), std::string::npos);
  all([](cv::Mat& shot) { shot.setTo(cv::Scalar::all(255)); });
  EXPECT_NE(failure().find("saturated"), std::string::npos);
}

TEST_F(DamagedResponse, UnusualLightIsSaid) {
  fs::remove_all(plan_.folder / "response" / "projector0" / "camera1");
  for (const char* white : {"001.png", "056.png"}) change(white, [](cv::Mat& shot) { shot = shot * 1.1; });
  for (const char* share :
       {"002.png", "003.png", "004.png", "005.png", "006.png", "007.png", "008.png", "009.png"})
    change(share, [](cv::Mat& shot) { shot = shot * 1.1; });
  const auto measured = measure_response(plan_);
  ASSERT_TRUE(measured.ok()) << measured.message();
  ASSERT_EQ(measured->warnings.size(), 2U);
  EXPECT_NE(measured->warnings[0].find("white boost"), std::string::npos) << measured->warnings[0];
}

}  // namespace
}  // namespace limn::calib
