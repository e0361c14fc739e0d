#include "tracker/gesture.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/marker_images.h"
#include "tracker/detector.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::uniform;

constexpr double k_frame_s = 1 / 30.0;
constexpr int k_side = 240;  // width of the image; a pixel is a millimetre of the table
const Eigen::Vector2d k_px_control(120, 120);
const MarkerName k_control{"aruco_4x4_50", "7"}, k_other{"aruco_4x4_50", "3"}, k_another{"aruco_4x4_50", "5"};

Eigen::Vector2d direction(double angle) { return {std::cos(angle), std::sin(angle)}; }

// A table with a control marker and two others, seen from above.
class Table {
 public:
  explicit Table(std::mt19937_64& rng) : rng_(rng) {
    others_ = {test::placed(lens_, k_other, k_px_control + 85 * direction(uniform(rng, 0, 6.28)), 32,
                            uniform(rng, 0, 6.28), 0.1, 0),
               test::placed(lens_, k_another, {40, 40}, 30, 0.3, 0.1, 0)};
  }

  cv::Mat light(double spin, double tilt) {
    std::vector<test::PlacedMarker> all = others_;
    all.push_back(test::placed(lens_, k_control, k_px_control, 40, spin, tilt, 0.4));
    return test::light_of(lens_, test::plain(k_side, k_side, 120), all, {.blur_px = 0.6}, rng_);
  }

  cv::Mat photographed(const cv::Mat& light) { return test::noisy_grey(light, 2, rng_); }

 private:
  std::mt19937_64& rng_;
  Lens lens_ = Lens::pinhole(1000, 1000, (k_side - 1) / 2.0, (k_side - 1) / 2.0);
  std::vector<test::PlacedMarker> others_;
};

class Watch {
 public:
  explicit Watch(Gesture gesture)
      : detector_(Families::load(std::vector<std::string>{"aruco_4x4_50"}).value()),
        reader_(k_control, gesture) {}
  int see(const cv::Mat& grey) {
    detector_.detect(grey, nullptr, &detections_);
    now_s_ += k_frame_s;
    return reader_.read(grey, detections_, shifted(Stamp{}, now_s_));
  }

 private:
  Detector detector_;
  GestureReader reader_;
  std::vector<Detection> detections_;
  double now_s_ = 10;
};

TEST(Gesture, TurnsCountStepsBothWays) {
  auto rng = test::test_rng();
  Table table(rng);
  Watch watch(Gesture::turn);
  const auto turn_to = [&](double from, double to) {
    int steps = 0;
    for (double t = 0; t <= 1; t += 0.1)
      steps += watch.see(table.photographed(table.light(from + t * (to - from), 0.3)));
    for (int i = 0; i < 12; ++i) steps += watch.see(table.photographed(table.light(to, 0.3)));
    return steps;
  };
  EXPECT_EQ(turn_to(0.1, 0.1), 0);
  EXPECT_EQ(turn_to(0.1, 0.1 + 40_deg), 1);
  EXPECT_EQ(turn_to(0.1 + 40_deg, 0.1 + 50_deg), 0);
  EXPECT_EQ(turn_to(0.1 + 50_deg, 0.1 + 5_deg), -1);
}

TEST(Gesture, LayingDownActsOnceUntilItStandsAgain) {
  auto rng = test::test_rng();
  Table table(rng);
  Watch watch(Gesture::lay);
  const auto rest_at = [&](double tilt) {
    int acts = 0;
    const cv::Mat light = table.light(0.3, tilt);
    for (int i = 0; i < 20; ++i) acts += watch.see(table.photographed(light));
    return acts;
  };
  EXPECT_EQ(rest_at(65_deg), 0);  // stands upright, seen from above
  EXPECT_EQ(rest_at(8_deg), 1);
  EXPECT_EQ(rest_at(8_deg), 0);
  EXPECT_EQ(rest_at(65_deg), 0);
  EXPECT_EQ(rest_at(8_deg), 1);
}

}  // namespace
}  // namespace limn::tracker
