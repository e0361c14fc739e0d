#include "tracker/balls/ball_finder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/ball_images.h"

namespace limn::tracker {
namespace {

using test::BallSurface;
using test::PlacedBall;
using test::uniform;

// A wide lens with barrel distortion: 84 degrees across 1280 px.
Lens wide_lens() {
  return Lens::create("LENSMODEL_OPENCV5", {700, 702, 641, 478, -0.18, 0.04, 3e-4, -2e-4, 0}).value();
}

PlacedBall ball_at(const Lens& lens, const Eigen::Vector2d& px, double diameter_px, BallSurface surface) {
  PlacedBall ball;
  ball.radius_m = 0.02;
  ball.surface = surface;
  // In the middle of the image an outline of this diameter; in the corner the lens makes it smaller or
  // larger.
  ball.p_camera = ball.radius_m / std::sin(diameter_px / 2 / lens.fx()) * lens.unproject(px).value();
  return ball;
}

struct Errors {
  int drawn = 0, found = 0, more = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double squares = 0, normalised = 0, angle_sum = 0, angle_normalised = 0;

  double rms() const { return std::sqrt(squares / (2 * found)); }
  Eigen::Vector2d mean() const { return sum / found; }
  double deviation_share() const { return std::sqrt(normalised / (2 * found)); }
};

// Adds what was found of one sphere.
void add(const Lens& lens, const PlacedBall& ball, const std::vector<Ball>& found, Errors* errors) {
  const Eigen::Vector2d true_px = lens.project(ball.p_camera).value();
  const double angle = std::asin(ball.radius_m / ball.p_camera.norm());
  ++errors->drawn;
  for (const Ball& one : found) {
    const Eigen::Vector2d error = one.centre_px - true_px;
    if (!(error.norm() < 2)) {
      ++errors->more;
      continue;
    }
    ++errors->found;
    errors->sum += error;
    errors->squares += error.squaredNorm();
    errors->normalised += error.dot(one.centre_covariance.inverse() * error);
    errors->angle_sum += one.half_angle / angle - 1;
    errors->angle_normalised += std::pow((one.half_angle - angle) / one.half_angle_stddev, 2);
  }
}

// `count` spheres, each in an image of its own, at places around `px`.
Errors errors_of(const Lens& lens,
                 const Eigen::Vector2d& px,
                 double diameter_px,
                 BallSurface surface,
                 int count,
                 std::mt19937_64& rng) {
  BallFinder finder;
  Errors errors;
  for (int i = 0; i < count; ++i) {
    PlacedBall ball =
        ball_at(lens, px + Eigen::Vector2d(uniform(rng, -8, 8), uniform(rng, -8, 8)), diameter_px, surface);
    ball.d_to_light = Eigen::Vector3d(uniform(rng, -0.8, 0.8), uniform(rng, -0.8, 0.3), -1).normalized();
    const cv::Mat image = test::image_of(lens, test::plain(1280, 960, 40), std::vector{ball},
                                         {.blur_px = 0.6, .noise_levels = 2}, rng);
    add(lens, ball, finder.find(image, lens), &errors);
  }
  return errors;
}

void expect_good(const Errors& errors, double rms_px, double bias_px) {
  ASSERT_EQ(errors.found, errors.drawn);
  EXPECT_EQ(errors.more, 0);
  EXPECT_LE(errors.rms(), rms_px);
  EXPECT_LE(errors.mean().norm(), bias_px) << errors.mean().transpose();
  EXPECT_GT(errors.deviation_share(), 0.7);
  EXPECT_LT(errors.deviation_share(), 1.4);
  EXPECT_LT(std::abs(errors.angle_sum / errors.found), 0.006);  // the distance is off by the same share
  EXPECT_LT(std::sqrt(errors.angle_normalised / errors.found), 1.5);
}

TEST(BallFinder, FindsTheCentreOfAFlatSphereOf20Px) {
  auto rng = test::test_rng();
  expect_good(errors_of(wide_lens(), {640, 480}, 20, BallSurface::flat, 60, rng), 0.05, 0.01);
}

TEST(BallFinder, FindsTheCentreOfAMattSphereWhereverItsLightIs) {
  auto rng = test::test_rng();
  expect_good(errors_of(wide_lens(), {640, 480}, 20, BallSurface::matt, 60, rng), 0.05, 0.02);
}

// Mean of the outline's pixels minus the centre's pixel.
Eigen::Vector2d ellipse_offset(const Lens& lens, const PlacedBall& ball) {
  const double angle = std::asin(ball.radius_m / ball.p_camera.norm());
  const Eigen::Vector3d axis = ball.p_camera.normalized(), a = axis.unitOrthogonal(), b = axis.cross(a);
  Eigen::Vector2d sum(0, 0);
  for (int i = 0; i < 360; ++i) {
    const Eigen::Vector3d across = std::cos(M_PI * i / 180) * a + std::sin(M_PI * i / 180) * b;
    sum += lens.project(std::cos(angle) * axis + std::sin(angle) * across).value();
  }
  return sum / 360 - lens.project(ball.p_camera).value();
}

TEST(BallFinder, HasNoBiasAtTheCornerOfAWideLens) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  expect_good(errors_of(lens, {60, 50}, 24, BallSurface::flat, 60, rng), 0.05, 0.005);
  expect_good(errors_of(lens, {140, 120}, 90, BallSurface::flat, 10, rng), 0.05, 0.01);
  EXPECT_GT(ellipse_offset(lens, ball_at(lens, {140, 120}, 90, BallSurface::flat)).norm(), 0.5);
}

TEST(BallFinder, FindsSmallSpheres) {
  auto rng = test::test_rng();
  expect_good(errors_of(wide_lens(), {400, 300}, 11, BallSurface::flat, 40, rng), 0.08, 0.03);
}

// In levels as the camera encodes them, the middle of an edge lies outside the sphere.
TEST(BallFinder, FindsADarkSphereThroughAnSrgbCamera) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  BallFinder finder({.shade = BallShade::dark, .encoding = Encoding::srgb});
  Errors errors;
  for (int i = 0; i < 20; ++i) {
    PlacedBall ball = ball_at(lens, {uniform(rng, 200, 1000), uniform(rng, 200, 700)}, 30, BallSurface::flat);
    ball.light = 20;
    cv::Mat light = test::light_of(lens, test::plain(1280, 960, 150), std::vector{ball}) / 255;
    cv::GaussianBlur(light, light, {}, 0.7);
    cv::Mat encoded;
    cv::pow(light, 1 / 2.4, encoded);  // the sRGB curve above its linear foot
    const cv::Mat image = test::noisy_grey(255 * (1.055 * encoded - 0.055), 2, rng);
    add(lens, ball, finder.find(image, lens), &errors);
  }
  EXPECT_EQ(errors.found, 20);
  EXPECT_EQ(errors.more, 0);
  EXPECT_LT(errors.rms(), 0.02);
  EXPECT_LT(std::abs(errors.angle_sum / errors.found), 0.004);
}

TEST(BallFinder, FindsEachOfManyInOneImageOnce) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  std::vector<PlacedBall> balls;
  for (int i = 0; i < 24; ++i)
    balls.push_back(
        ball_at(lens, {150.0 + 190 * (i % 6), 150.0 + 200 * (i / 6)}, 12 + 2 * i, BallSurface::matt));
  const cv::Mat image =
      test::image_of(lens, test::plain(1280, 960, 30), balls, {.blur_px = 0.6, .noise_levels = 2}, rng);
  BallFinder finder({.shade = BallShade::any});
  const std::vector<Ball> found = finder.find(image, lens);
  EXPECT_EQ(found.size(), balls.size());
  for (const PlacedBall& ball : balls) {
    const Eigen::Vector2d px = lens.project(ball.p_camera).value();
    EXPECT_EQ(
        std::ranges::count_if(found, [&](const Ball& one) { return (one.centre_px - px).norm() < 0.1; }), 1)
        << px.transpose();
  }
}

// A retroreflective sphere that is three times too bright: its image grows alike on all sides.
TEST(BallFinder, AnOverexposedSphereKeepsItsCentre) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  BallFinder finder;
  Errors errors;
  for (int i = 0; i < 20; ++i) {
    PlacedBall ball = ball_at(lens, {uniform(rng, 200, 1000), uniform(rng, 200, 700)}, 20, BallSurface::flat);
    ball.light = 750;
    const cv::Mat image = test::image_of(lens, test::plain(1280, 960, 20), std::vector{ball},
                                         {.blur_px = 0.8, .noise_levels = 2}, rng);
    add(lens, ball, finder.find(image, lens), &errors);
  }
  ASSERT_EQ(errors.found, 20);
  EXPECT_EQ(errors.more, 0);
  EXPECT_LT(errors.rms(), 0.05);
}

// Edges of the background beside the outline pull at it; the covariance says so.
TEST(BallFinder, FindsSpheresBeforeClutter) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  BallFinder finder;
  Errors errors;
  for (int i = 0; i < 40; ++i) {
    PlacedBall ball = ball_at(lens, {uniform(rng, 200, 1000), uniform(rng, 200, 700)}, 30, BallSurface::matt);
    cv::Mat background = test::clutter(1280, 960, rng);
    background.convertTo(background, CV_8U, 0.4);
    const cv::Mat image =
        test::image_of(lens, background, std::vector{ball}, {.blur_px = 0.6, .noise_levels = 2}, rng);
    add(lens, ball, finder.find(image, lens), &errors);
  }
  EXPECT_GE(errors.found, 26);  // the others are refused
  EXPECT_LT(errors.rms(), 0.15);
  EXPECT_LT(errors.deviation_share(), 1.5);
}

// Ellipses that are no sphere's outline there, squares, hexagons, a sphere behind a bar, one that leaves the
// image.
TEST(BallFinder, RefusesWhatIsNoWholeSphere) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  const std::vector<PlacedBall> balls = {ball_at(lens, {640, 480}, 40, BallSurface::matt),
                                         ball_at(lens, {2, 300}, 40, BallSurface::matt)};
  cv::Mat image = test::image_of(lens, test::plain(1280, 960, 40), balls, {}, rng);
  cv::rectangle(image, {630, 440, 8, 100}, cv::Scalar(40), cv::FILLED);
  for (int i = 0; i < 20; ++i) {
    const cv::Point at(100 + 58 * i, 850);
    cv::ellipse(image, at, {20, 16}, 17.0 * i, 0, 360, cv::Scalar(200), cv::FILLED, cv::LINE_AA);
    cv::rectangle(image, {at.x - 10, 700, 21, 20}, cv::Scalar(200), cv::FILLED);
    std::vector<cv::Point> hexagon;
    for (int k = 0; k < 6; ++k)
      hexagon.emplace_back(at.x + static_cast<int>(std::lround(20 * std::cos(M_PI * k / 3 + i))),
                           120 + static_cast<int>(std::lround(20 * std::sin(M_PI * k / 3 + i))));
    cv::fillConvexPoly(image, hexagon, cv::Scalar(200), cv::LINE_AA);
  }
  cv::GaussianBlur(image, image, {}, 0.7);
  BallFinder finder({.shade = BallShade::any});
  for (const Ball& ball : finder.find(image, lens))
    ADD_FAILURE() << ball.centre_px.transpose() << " radius " << ball.radius_px;
  EXPECT_TRUE(finder.find({}, lens).empty());
  EXPECT_TRUE(finder.find(test::noise(640, 480, rng), lens).empty());
}

// Covers everything on one side of a line through the image with one light, up to the line's very place.
void cover(const Eigen::Vector2d& px_line, double direction, double level, cv::Mat* light) {
  const Eigen::Vector2d normal(std::cos(direction), std::sin(direction));
  for (int y = 0; y < light->rows; ++y)
    for (int x = 0; x < light->cols; ++x) {
      const double covered = std::clamp(normal.dot(Eigen::Vector2d(x, y) - px_line) + 0.5, 0.0, 1.0);
      float& at = light->at<float>(y, x);
      at = static_cast<float>((1 - covered) * at + covered * level);
    }
}

// Spheres of 40 px before something of that light that covers a share of their outlines.
Errors errors_of_covered(double share, double level, std::mt19937_64& rng) {
  const Lens lens = wide_lens();
  BallFinder finder;
  Errors errors;
  for (int i = 0; i < 30; ++i) {
    PlacedBall ball = ball_at(lens, {uniform(rng, 200, 1000), uniform(rng, 200, 700)}, 40, BallSurface::matt);
    ball.d_to_light = Eigen::Vector3d(uniform(rng, -0.5, 0.5), uniform(rng, -0.5, 0.3), -1).normalized();
    cv::Mat light = test::light_of(lens, test::plain(1280, 960, 40), std::vector{ball});
    const double direction = uniform(rng, -M_PI, M_PI);
    // The ends of the covered arc are `share` of a half turn from its middle.
    const Eigen::Vector2d px = lens.project(ball.p_camera).value();
    const auto edge = lens.unproject(px + Eigen::Vector2d(1, 0)).value();
    const double px_per_radian = 1 / std::acos(edge.dot(ball.p_camera.normalized()));
    const double radius_px = px_per_radian * std::asin(ball.radius_m / ball.p_camera.norm());
    const Eigen::Vector2d towards(std::cos(direction), std::sin(direction));
    cover(px + radius_px * std::cos(M_PI * share) * towards, direction, level, &light);
    cv::GaussianBlur(light, light, {}, 0.6);
    add(lens, ball, finder.find(test::noisy_grey(light, 2, rng), lens), &errors);
  }
  return errors;
}

TEST(BallFinder, FindsTheCentreOfASphereThatIsCoveredInPart) {
  auto rng = test::test_rng();
  for (const double share : {0.1, 0.25, 0.4}) {
    SCOPED_TRACE(share);
    const Errors errors = errors_of_covered(share, 15, rng);
    EXPECT_GE(errors.found, share < 0.2 ? 26 : share < 0.3 ? 16 : 8);
    EXPECT_EQ(errors.more, 0);
    EXPECT_LT(errors.rms(), share < 0.2 ? 0.05 : 0.08);
    EXPECT_LT(errors.mean().norm(), 0.03);
    EXPECT_GT(errors.deviation_share(), 0.6);
    EXPECT_LT(errors.deviation_share(), 1.5);
    EXPECT_LT(std::sqrt(errors.angle_normalised / errors.found), 1.6);
  }
  EXPECT_EQ(errors_of_covered(0.6, 15, rng).found, 0);  // too little is left
}

// The centres are 1.02 diameters apart, so that the threshold makes one region of both, or the nearer covers
// a part of the other.
TEST(BallFinder, TouchingSpheresAreBothFound) {
  auto rng = test::test_rng();
  const Lens lens = wide_lens();
  BallFinder finder;
  for (const double apart : {0.8, 0.9, 1.02}) {
    SCOPED_TRACE(apart);
    Errors errors;
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d px(uniform(rng, 250, 1000), uniform(rng, 250, 700));
      const double turn = uniform(rng, -M_PI, M_PI);
      const PlacedBall one = ball_at(lens, px, 40, BallSurface::matt);
      PlacedBall other = one;
      other.p_camera += 2 * apart * one.radius_m * Eigen::Vector3d(std::cos(turn), std::sin(turn), 0);
      other.p_camera *= 1.03;  // behind it
      const std::vector<PlacedBall> balls = {one, other};
      const cv::Mat image =
          test::image_of(lens, test::plain(1280, 960, 40), balls, {.blur_px = 0.6, .noise_levels = 2}, rng);
      const std::vector<Ball> found = finder.find(image, lens);
      EXPECT_LE(found.size(), 2u);
      for (const PlacedBall& ball : balls) {
        const Eigen::Vector2d at = lens.project(ball.p_camera).value();
        std::vector<Ball> near;
        std::ranges::copy_if(found, std::back_inserter(near),
                             [&](const Ball& f) { return (f.centre_px - at).norm() < 2; });
        add(lens, ball, near, &errors);
      }
    }
    EXPECT_GE(errors.found, 28);
    EXPECT_LT(errors.rms(), 0.1);
    EXPECT_LT(errors.deviation_share(), 1.6);
  }
}

}  // namespace
}  // namespace limn::tracker
