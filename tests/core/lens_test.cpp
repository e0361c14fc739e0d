#include "core/lens.h"

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test::literals;

struct LensCase {
  std::string name;
  std::string model;
  std::vector<double> values;
};

std::vector<double> splined_values(int count) {
  std::vector<double> values = {900, 905, 639.5, 399.5};
  for (int i = 4; i < count; ++i) values.push_back(0.01 * std::sin(0.7 * i));
  return values;
}

std::vector<LensCase> lens_cases() {
  const std::string splined = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=12_Ny=8_fov_x_deg=90";
  return {
      {"Pinhole", "LENSMODEL_PINHOLE", {1000, 1010, 640, 380}},
      {"Opencv4", "LENSMODEL_OPENCV4", {1500, 1490, 630, 900, -0.15, 0.02, 0.001, -0.002}},
      {"Opencv8",
       "LENSMODEL_OPENCV8",
       {1200, 1205, 640, 400, -0.2, 0.05, 0.001, -0.0005, 0.01, 0.1, 0.02, 0.003}},
      {"Splined", splined, splined_values(LensModel::parse(splined)->value_count())},
  };
}

class LensModels : public testing::TestWithParam<LensCase> {
 protected:
  Lens lens() const { return Lens::create(GetParam().model, GetParam().values).value(); }
  // Directions over an image of about 1280x800.
  std::vector<Eigen::Vector3d> directions() const {
    std::vector<Eigen::Vector3d> directions;
    for (double x = -0.5; x <= 0.5; x += 0.125) {
      for (double y = -0.3; y <= 0.3; y += 0.1) directions.push_back(Eigen::Vector3d(x, y, 1));
    }
    return directions;
  }
};

TEST_P(LensModels, UnprojectInvertsProject) {
  for (const auto& p : directions()) {
    const auto px = lens().project(p);
    ASSERT_TRUE(px);
    const auto d = lens().unproject(*px);
    ASSERT_TRUE(d);
    EXPECT_TRUE(test::near(*d, p.normalized(), 1e-9));
  }
}

TEST_P(LensModels, DistanceAlongTheRayDoesNotMoveThePixel) {
  for (const auto& p : directions())
    EXPECT_TRUE(test::near(*lens().project(p), *lens().project(7 * p), 1e-9));
}

TEST_P(LensModels, JacobiansEqualFiniteDifferences) {
  const LensModel model = lens().model;
  const auto count = static_cast<std::size_t>(model.value_count());
  for (const auto& p : directions()) {
    Eigen::Vector2d px;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_p;
    std::vector<double> d_values(2 * count);
    ASSERT_TRUE(model.project(GetParam().values, p, &px, d_p.data(), d_values.data()));
    const double h = 1e-6;
    for (int i = 0; i < 3; ++i) {
      Eigen::Vector2d forward, backward;
      ASSERT_TRUE(model.project(GetParam().values, p + h * Eigen::Vector3d::Unit(i), &forward));
      ASSERT_TRUE(model.project(GetParam().values, p - h * Eigen::Vector3d::Unit(i), &backward));
      EXPECT_TRUE(test::near(d_p.col(i), (forward - backward) / (2 * h), 1e-3)) << "dp" << i;
    }
    for (std::size_t i = 0; i < count; ++i) {
      auto up = GetParam().values, down = GetParam().values;
      const double step = h * std::max(1.0, std::abs(up[i]));
      up[i] += step;
      down[i] -= step;
      Eigen::Vector2d forward, backward;
      ASSERT_TRUE(model.project(up, p, &forward));
      ASSERT_TRUE(model.project(down, p, &backward));
      const Eigen::Vector2d expected = (forward - backward) / (2 * step);
      EXPECT_TRUE(test::near(Eigen::Vector2d(d_values[i], d_values[count + i]), expected, 1e-3))
          << "value " << i;
    }
  }
}

TEST_P(LensModels, ManyPointsAtOnceEqualSingleOnes) {
  const LensModel model = lens().model;
  const std::vector<Eigen::Vector3d> points = directions();
  std::vector<Eigen::Vector2d> px(points.size()), px_alone(points.size());
  std::vector<PixelByPoint> d_p(points.size());
  ASSERT_TRUE(model.project_all(GetParam().values, points, px, d_p));
  ASSERT_TRUE(model.project_all(GetParam().values, points, px_alone));
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d expected;
    PixelByPoint d_expected;
    ASSERT_TRUE(model.project(GetParam().values, points[i], &expected, d_expected.data()));
    EXPECT_TRUE(test::near(px[i], expected, 1e-9));
    EXPECT_TRUE(test::near(px_alone[i], expected, 1e-9));
    EXPECT_LT((d_p[i] - d_expected).norm(), 1e-9);
  }
}

TEST_P(LensModels, ManyPointsHaveNoPixelsWhenOneHasNone) {
  const LensModel model = lens().model;
  std::vector<Eigen::Vector3d> points = directions();
  std::vector<Eigen::Vector2d> px(points.size());
  std::vector<Eigen::Vector3d> hopeless = {Eigen::Vector3d::Zero(), {std::nan(""), 0, 1}};
  if (!model.projects_behind()) hopeless.push_back({0.1, 0, -1});
  for (const Eigen::Vector3d& bad : hopeless) {
    points[7] = bad;
    EXPECT_FALSE(model.project_all(GetParam().values, points, px)) << bad.transpose();
  }
}

TEST_P(LensModels, DirectionMapEqualsSingleUnprojections) {
  const auto map = direction_map(lens(), 1280, 800, 64);
  ASSERT_EQ(map.size(), 20u * 13u);
  const auto d = lens().unproject({5 * 64.0, 3 * 64.0});
  ASSERT_TRUE(d);
  EXPECT_TRUE(test::near(map[3 * 20 + 5].cast<double>(), *d, 1e-6));
}

INSTANTIATE_TEST_SUITE_P(Models, LensModels, testing::ValuesIn(lens_cases()), [](const auto& info) {
  return info.param.name;
});

TEST(Lens, PixelZeroIsTheCentreOfTheTopLeftPixel) {
  const Lens lens = Lens::pinhole(100, 100, 0, 0);
  EXPECT_TRUE(test::near(*lens.project({0, 0, 1}), Eigen::Vector2d(0, 0), 1e-15));
}

TEST(Lens, PointsBehindHaveNoPixel) {
  const Lens lens = Lens::pinhole(100, 100, 50, 50);
  EXPECT_FALSE(lens.project({0, 0, -1}));
  EXPECT_FALSE(lens.project({0, 0, 0}));
  EXPECT_FALSE(lens.project({std::nan(""), 0, 1}));
}

// A lens with k1 = -0.15 folds at tan = 1.49; at tan = 2.4 the polynomial alone gives a pixel near the
// centre.
TEST(Lens, AFoldedPolynomialGivesNoPixelFarOffTheAxis) {
  const Lens lens = Lens::create("LENSMODEL_OPENCV4", {1000, 1000, 640, 400, -0.15, 0, 0, 0}).value();
  EXPECT_TRUE(lens.project({1.3, 0, 1}));
  EXPECT_FALSE(lens.project({2.4, 0, 1}));
  EXPECT_FALSE(lens.project({4, 0, 1}));
}

TEST(Lens, PixelsOutsideTheModelsRangeHaveNoDirection) {
  const Lens lens = Lens::create("LENSMODEL_OPENCV4", {1000, 1000, 640, 400, -0.15, 0, 0, 0}).value();
  EXPECT_TRUE(lens.unproject({640 + 990, 400}));
  EXPECT_FALSE(lens.unproject({640 + 1100, 400})) << "the largest radius is 1000 * 2/3 * 1.49 = 994 px";
}

TEST(Lens, CreateNamesWhatIsWrong) {
  const auto unknown = Lens::create("LENSMODEL_FISHBOWL", {1, 1, 0, 0});
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.message().find("LENSMODEL_FISHBOWL"), std::string::npos);
  const auto few = Lens::create("LENSMODEL_OPENCV4", {1, 1, 0, 0});
  ASSERT_FALSE(few);
  EXPECT_NE(few.message().find("expected 8 numbers"), std::string::npos) << few.message();
  const auto negative = Lens::create("LENSMODEL_PINHOLE", {-1, 1, 0, 0});
  ASSERT_FALSE(negative);
  EXPECT_NE(negative.message().find("focal length"), std::string::npos) << negative.message();
  EXPECT_FALSE(Lens::create("LENSMODEL_PINHOLE", {1, 1, std::nan(""), 0}));
}

}  // namespace
}  // namespace limn
