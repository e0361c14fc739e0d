#include "sim/sensor_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test;
using Images = std::vector<cv::Mat>;

Images flat(int value) { return {cv::Mat(150, 200, CV_8U, cv::Scalar(value))}; }

// Compares the light of the wall with and without one effect, as a ratio at a few illuminated pixels.
struct Fixture {
  sim::World world = small_world();
  sim::Samples samples = sim::trace(world, 0);
  float at(const Images& shown, int column = 160, int row = 120) const {
    return sim::ideal_light(world, samples, shown).at<float>(row, column);
  }
  const sim::ProjectorView& view(int column, int row) const {
    return samples.projectors[0][static_cast<std::size_t>(row * 320 + column)];
  }
};

cv::Mat flat_signal(double value) { return {480, 640, CV_32F, cv::Scalar(value)}; }

std::pair<double, double> mean_and_variance(const cv::Mat& levels) {
  cv::Scalar mean, stddev;
  cv::meanStdDev(levels, mean, stddev);
  return {mean[0], stddev[0] * stddev[0]};
}

TEST(Photograph, WhiteLightIsIlluminanceTimesGainTimesAlbedo) {
  Fixture f;
  f.world.projector_effects[0].illuminance_at_1m = 3;
  EXPECT_NEAR(f.at(flat(255)), 3 * f.view(160, 120).gain, 1e-5);
  EXPECT_EQ(f.at({}), 0);
}

TEST(Photograph, FloatImagesAreLightAlready) {
  Fixture f;
  f.world.projector_effects[0].illuminance_at_1m = 3;
  const float white = f.at(flat(255));
  f.world.projector_effects[0].gamma = 2.2;
  f.world.projector_effects[0].black_level = 0.1;
  const Images quarter = {cv::Mat(150, 200, CV_32FC3, cv::Scalar::all(0.25))};
  EXPECT_NEAR(f.at(quarter), 0.25F * white, 1e-5F);
}

TEST(Photograph, GammaChangesMidTonesOnly) {
  Fixture f;
  const float white = f.at(flat(255)), middle = f.at(flat(128));
  EXPECT_NEAR(middle / white, 128.0 / 255, 1e-5);
  f.world.projector_effects[0].gamma = 2.2;
  EXPECT_NEAR(f.at(flat(255)), white, 1e-6);
  EXPECT_NEAR(f.at(flat(128)) / white, std::pow(128.0 / 255, 2.2), 1e-5);
}

TEST(Photograph, ChannelsMayHaveResponsesOfTheirOwn) {
  Fixture f;
  f.world.camera_effects[0].colour = true;
  sim::ProjectorEffects& effects = f.world.projector_effects[0];
  effects.gamma = 2;
  effects.channel_gamma = {1.2, 1, 0.8};
  effects.s_curve = 0.25;
  const auto light = [&](const Images& shown) {
    return sim::ideal_light(f.world, f.samples, shown).at<cv::Vec3f>(120, 160);
  };
  const double v = 128.0 / 255, step = v * v * (3 - 2 * v);
  const Images coloured = {cv::Mat(150, 200, CV_8UC3, cv::Scalar::all(128))};
  for (const Images& shown : {flat(128), coloured}) {
    for (int c = 0; c < 3; ++c) {
      const double share = 0.75 * std::pow(v, 2 * effects.channel_gamma[c]) + 0.25 * step;
      EXPECT_NEAR(light(shown)[c] / light(flat(255))[c], share, 1e-5) << c;
    }
  }
}

TEST(Photograph, ACamerasColoursOverlap) {
  Fixture f;
  f.world.camera_effects[0].colour = true;
  // The camera's green also sees a little red.
  f.world.camera_effects[0].sensitivity << 0.9, 0.1, 0, 0, 0.8, 0.2, 0, 0, 1;
  const Images red = {cv::Mat(150, 200, CV_8UC3, cv::Scalar(0, 0, 255))};
  const auto seen = sim::ideal_light(f.world, f.samples, red).at<cv::Vec3f>(120, 160);
  EXPECT_EQ(seen[0], 0);
  EXPECT_NEAR(seen[1] / seen[2], 0.2, 1e-5);
}

TEST(Photograph, BlackLevelLiftsBlackAndKeepsWhite) {
  Fixture f;
  const float white = f.at(flat(255));
  f.world.projector_effects[0].black_level = 0.01;
  EXPECT_NEAR(f.at({}) / white, 0.01, 1e-5);
  EXPECT_NEAR(f.at(flat(0)) / white, 0.01, 1e-5);
  EXPECT_NEAR(f.at(flat(255)), white, 1e-6);
}

TEST(Photograph, ProjectorVignettingDarkensTowardsThePanelsCorners) {
  Fixture f;
  const float before = f.at(flat(255), 100, 60);
  f.world.projector_effects[0].vignetting = 0.3;
  const double dx = f.view(100, 60).u - 99.5, dy = f.view(100, 60).v - 74.5;
  const double loss = 0.3 * (dx * dx + dy * dy) / (100 * 100 + 75 * 75);
  EXPECT_GT(loss, 0.01);
  EXPECT_NEAR(f.at(flat(255), 100, 60) / before, 1 - loss, 1e-5);
}

TEST(Photograph, FalloffAndIncidenceCanBeSwitchedOffEach) {
  Fixture f;
  const float before = f.at(flat(255));
  const Eigen::Vector3d p_light = f.world.rig.projectors[0].imager_from_world.inverse().translation;
  const Eigen::Vector3d towards = p_light - f.samples.p_world[120 * 320 + 160].cast<double>();
  f.world.projector_effects[0].falloff = false;
  EXPECT_NEAR(f.at(flat(255)) / before, towards.squaredNorm(), 1e-4);
  f.world.projector_effects[0].falloff = true;
  f.world.projector_effects[0].incidence = false;
  EXPECT_NEAR(f.at(flat(255)) / before, towards.norm() / -towards.y(), 1e-4);
}

TEST(Photograph, DefocusWidensAnEdgeByTheDiscOfConfusion) {
  Fixture f;
  f.world.rig.projectors[0].lens = Lens::pinhole(2000, 2000, 99.5, 74.5);
  f.world.rig.projectors[0].imager_from_world = f.world.rig.cameras[0].imager_from_world;
  f.world.rig.cameras[0].lens = Lens::pinhole(2000, 2000, 159.5, 119.5);
  f.samples = sim::trace(f.world, 0);  // one camera pixel is one projector pixel
  cv::Mat line = cv::Mat::zeros(150, 200, CV_8U);
  line.col(100).setTo(255);
  const auto spread = [&] {  // second moment of the line's profile
    const cv::Mat light = sim::ideal_light(f.world, f.samples, Images{line});
    double sum = 0, first = 0, second = 0;
    for (int c = 130; c < 192; ++c) {
      const double v = light.at<float>(120, c);
      sum += v, first += v * c, second += v * c * c;
    }
    return std::pair{sum, std::sqrt(std::max(0.0, second / sum - std::pow(first / sum, 2)))};
  };
  const auto sharp = spread();
  f.world.projector_effects[0].focus_m = 0.8;
  f.world.projector_effects[0].aperture_m = 0.02;
  const auto blurred = spread();
  // 10 px diameter; the standard deviation is a quarter of it.
  const double disc_px = 2000 * 0.02 * (1 / 0.8 - 1 / 1.0);
  EXPECT_NEAR(blurred.second * blurred.second - sharp.second * sharp.second, std::pow(disc_px / 4, 2), 0.3);
  EXPECT_NEAR(blurred.first, sharp.first, 2e-3 * sharp.first);  // no light lost
}

TEST(Photograph, ExposureScalesAndPsfKeepsEnergy) {
  sim::World world = small_world();
  cv::Mat light = cv::Mat::zeros(240, 320, CV_32F);
  light.at<float>(100, 150) = 7;
  world.camera_effects[0].exposure = 0.5;
  EXPECT_NEAR(sim::exposed(world, 0, light).at<float>(100, 150), 3.5, 1e-6);
  world.camera_effects[0].psf_px = 1.3;
  const cv::Mat blurred = sim::exposed(world, 0, light);
  EXPECT_NEAR(cv::sum(blurred)[0], 3.5, 1e-4);
  double second = 0;
  for (int r = 0; r < 240; ++r)
    for (int c = 0; c < 320; ++c)
      second += static_cast<double>(blurred.at<float>(r, c)) * (c - 150) * (c - 150);
  EXPECT_NEAR(std::sqrt(second / 3.5), 1.3, 0.01);
}

TEST(Photograph, AShakingCameraDisplacesEachFrameAsStated) {
  sim::World world = small_world();
  world.camera_effects[0].shake_px = 0.2;
  cv::Mat light = cv::Mat::zeros(240, 320, CV_32F);
  light.at<float>(100, 150) = 7;
  for (const double psf_px : {0.0, 0.7}) {
    world.camera_effects[0].psf_px = psf_px;
    double squared = 0;
    constexpr int k_frames = 60;
    for (std::uint64_t seed = 0; seed < k_frames; ++seed) {
      const sim::Disturbance shaken = sim::disturbance(world, 0, seed);
      const cv::Mat signal = sim::exposed(world, 0, light, shaken);
      const cv::Moments moments = cv::moments(signal);
      EXPECT_NEAR(moments.m00, 7, 1e-3);
      EXPECT_NEAR(moments.m10 / moments.m00, 150 + shaken.shift_px.x(), 2e-3);
      EXPECT_NEAR(moments.m01 / moments.m00, 100 + shaken.shift_px.y(), 2e-3);
      squared += shaken.shift_px.squaredNorm() / (2 * k_frames);
    }
    EXPECT_NEAR(std::sqrt(squared), 0.2, 0.04);
  }
}

TEST(Photograph, FlickerScalesEachFrameAsStated) {
  sim::World world = small_world();
  world.camera_effects[0].flicker = 0.015;
  double squared = 0;
  constexpr int k_frames = 200;
  for (std::uint64_t seed = 0; seed < k_frames; ++seed) {
    const sim::Disturbance lit = sim::disturbance(world, 0, seed);
    EXPECT_EQ(lit.shift_px, Eigen::Vector2d(0, 0));
    EXPECT_NEAR(sim::exposed(world, 0, flat_signal(0.5), lit).at<float>(5, 5), 0.5 * lit.gain, 1e-5);
    squared += (lit.gain - 1) * (lit.gain - 1) / k_frames;
  }
  EXPECT_NEAR(std::sqrt(squared), 0.015, 0.003);
}

TEST(Photograph, CameraVignettingDarkensTheCornersAlone) {
  sim::World world = small_world();
  world.camera_effects[0].vignetting = 0.4;
  const cv::Mat signal = sim::exposed(world, 0, cv::Mat(240, 320, CV_32F, cv::Scalar(1)));
  EXPECT_NEAR(signal.at<float>(120, 160), 1, 1e-4);
  EXPECT_NEAR(signal.at<float>(0, 0), 0.6, 0.005);
}

TEST(Photograph, WithoutEffectsLevelsAreTheRoundedSignal) {
  const sim::World world = small_world();
  for (const double value : {0.0, 0.1, 0.4999, 1.0, 1.7}) {
    const cv::Mat levels = sim::digitised(world, 0, flat_signal(value), 1);
    const double expected = std::min(255.0, std::round(value * 255));
    EXPECT_EQ(cv::countNonZero(levels != expected), 0) << value;
  }
}

TEST(Photograph, BlackLevelAndEncodingShiftLevelsAsStated) {
  sim::World world = small_world();
  world.camera_effects[0].black_level = 10;
  EXPECT_EQ(sim::digitised(world, 0, flat_signal(0), 1).at<std::uint8_t>(5, 5), 10);
  EXPECT_EQ(sim::digitised(world, 0, flat_signal(1), 1).at<std::uint8_t>(5, 5), 255);
  world.camera_effects[0].black_level = 0;
  world.camera_effects[0].srgb = true;
  // The middle of the sRGB range.
  EXPECT_EQ(sim::digitised(world, 0, flat_signal(0.2140), 1).at<std::uint8_t>(5, 5), 127);
}

TEST(Photograph, ReadNoiseHasTheInjectedDeviationAtEveryLevel) {
  sim::World world = small_world();
  world.camera_effects[0].read_noise = 3;
  for (const double value : {0.2, 0.7}) {
    const auto [mean, variance] = mean_and_variance(sim::digitised(world, 0, flat_signal(value), 5));
    EXPECT_NEAR(mean, value * 255, 0.05);
    // Rounding to whole levels adds 1/12; the standard deviation for 300 000 pixels is 0.004.
    EXPECT_NEAR(std::sqrt(variance - 1.0 / 12), 3, 0.02);
  }
}

TEST(Photograph, ShotNoiseVarianceIsProportionalToLight) {
  sim::World world = small_world();
  world.camera_effects[0].full_well_e = 2000;
  for (const double value : {0.1, 0.4, 0.8}) {
    const auto [mean, variance] = mean_and_variance(sim::digitised(world, 0, flat_signal(value), 6));
    const double expected = value / 2000 * 255 * 255;
    EXPECT_NEAR(variance - 1.0 / 12, expected, 0.02 * expected) << value;
  }
}

TEST(Photograph, NoiseOfNeighboursRowsAndShotsIsIndependent) {
  sim::World world = small_world();
  world.camera_effects[0].read_noise = 5;
  const auto residual = [&](std::uint64_t seed) {
    cv::Mat r;
    sim::digitised(world, 0, flat_signal(0.5), seed).convertTo(r, CV_32F, 1, -127.5);
    return r;
  };
  const cv::Mat a = residual(1), b = residual(2);
  const auto correlation = [&](const cv::Mat& x, const cv::Mat& y) {
    return x.dot(y) / std::sqrt(x.dot(x) * y.dot(y));
  };
  EXPECT_LT(std::abs(correlation(a, b)), 0.01);
  EXPECT_LT(std::abs(correlation(a.colRange(0, 639), a.colRange(1, 640))), 0.01);
  EXPECT_LT(std::abs(correlation(a.rowRange(0, 479), a.rowRange(1, 480))), 0.01);
}

TEST(Photograph, TheSameSeedGivesTheSameBytes) {
  Fixture f;
  f.world.camera_effects[0].read_noise = 2;
  f.world.camera_effects[0].full_well_e = 5000;
  const cv::Mat a = sim::photograph(f.world, f.samples, flat(200), 42),
                b = sim::photograph(f.world, f.samples, flat(200), 42);
  const cv::Mat c = sim::photograph(f.world, f.samples, flat(200), 43);
  EXPECT_EQ(cv::countNonZero(a != b), 0);
  EXPECT_GT(cv::countNonZero(a != c), 1000);
}

TEST(Photograph, AColourCameraSeesColouredLightOnColouredPaint) {
  Fixture f;
  f.world.camera_effects[0].colour = true;
  f.world.objects[0].albedo = {0.2, 0.5, 0.8};
  f.samples = sim::trace(f.world, 0);
  const Images shown = {cv::Mat(150, 200, CV_8UC3, cv::Scalar(255, 0, 255))};
  const cv::Vec3f light = sim::ideal_light(f.world, f.samples, shown).at<cv::Vec3f>(120, 160);
  EXPECT_NEAR(light[0], 0.2 * f.view(160, 120).gain, 1e-5);
  EXPECT_EQ(light[1], 0);
  EXPECT_NEAR(light[2], 0.8 * f.view(160, 120).gain, 1e-5);
}

TEST(Photograph, AnImageOfAnotherSizeIsOurBug) {
  const Fixture f;
  EXPECT_THROW((void)sim::ideal_light(f.world, f.samples, Images{cv::Mat::zeros(10, 10, CV_8U)}),
               std::logic_error);
}

}  // namespace
}  // namespace limn
