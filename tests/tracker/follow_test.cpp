#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"
#include "tracker/pattern_fit.h"

namespace limn::tracker {
namespace {

TEST(Detector, FollowsMarkersThatMoveByHalfTheirSide) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  const cv::Mat first = scattered_markers(0, rng);
  const auto last = detector.detect(first);
  ASSERT_EQ(last.size(), 6);
  for (const int moved : {0, 1, 5, 12, 25}) {
    const cv::Mat grey = scattered_markers(moved, rng);
    const auto anew = detector.detect(grey);
    std::vector<Detection> found;
    detector.follow(grey, nullptr, last, &found);
    ASSERT_EQ(anew.size(), 6);
    ASSERT_EQ(found.size(), 6) << moved;
    for (const Detection& marker : found) {
      const auto same = std::find_if(anew.begin(), anew.end(),
                                     [&](const Detection& d) { return d.marker.id == marker.marker.id; });
      ASSERT_NE(same, anew.end());
      expect_same({marker}, {*same}, 0.1);
    }
  }
}

TEST(Detector, FollowsMarkersUnderFingersToTheImagesEnd) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  const cv::Mat first = scattered_markers(0, rng);
  const auto last = detector.detect(first);
  cv::Mat covered = first.clone();
  for (const Detection& marker : last) {
    const Eigen::Vector2d at = marker.corners_px[0];
    cv::circle(covered, {static_cast<int>(at.x()), static_cast<int>(at.y())}, 8, cv::Scalar(120), -1);
  }
  std::vector<Detection> found;
  detector.follow(covered, nullptr, last, &found);
  EXPECT_EQ(found.size(), last.size());
  detector.follow(cv::Mat(first, cv::Rect(0, 0, 200, 200)), nullptr, last, &found);
  EXPECT_EQ(found.size(), 1);
  detector.follow(test::plain(640, 480, 100), nullptr, last, &found);
  EXPECT_TRUE(found.empty());
  detector.follow(cv::Mat(), nullptr, last, &found);
  EXPECT_TRUE(found.empty());
}

double square_error(const Detection& found, const std::array<Eigen::Vector2d, 4>& truth) {
  double sum = 0;
  for (std::size_t k = 0; k < 4; ++k) sum += (found.corners_px[k] - truth[k]).squaredNorm();
  return sum / 4;
}

// A blurred marker moves and turns, in light that falls and rises. Its pattern is fitted anew from time to
// time and followed between, with the same accuracy.
TEST(Detector, FollowsABlurredMarkerByItsPattern) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  std::vector<Detection> last, found;
  double followed = 0, anew = 0, pulls = 0;
  int fits = 0, count = 0;
  for (int i = 0; i < 100; ++i) {
    const std::vector<PlacedMarker> marker = {test::placed(
        pinhole_vga(), {"apriltag_36h11", "3"}, {300 + 0.37 * i, 240}, 40, 0.2 + 0.01 * i, 20_deg, 0)};
    const int level = 170 + static_cast<int>(40 * std::sin(0.1 * i));
    const cv::Mat grey = test::image_of(pinhole_vga(), test::plain(640, 480, level), marker,
                                        {.blur_px = 1.2, .noise_levels = 2}, rng);
    const auto truth = test::true_corners(pinhole_vga(), marker[0]);
    if (i == 0)
      detector.detect(grey, nullptr, &found);
    else
      detector.follow(grey, nullptr, last, &found);
    ASSERT_EQ(found.size(), 1u) << i;
    ASSERT_TRUE(found[0].by_pattern) << i;
    if (found[0].by_pattern->age == 0) {
      ++fits;
    } else {
      const auto alone = detector.detect(grey);
      ASSERT_EQ(alone.size(), 1u);
      followed += square_error(found[0], truth);
      anew += square_error(alone[0], truth);
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d e = found[0].corners_px[k] - truth[k];
        pulls += 0.125 * e.dot(found[0].corner_covariance[k].inverse() * e);
      }
      ++count;
    }
    last = found;
  }
  std::printf("fitted in %d of 100 pictures; between, off by %.3f px, anew by %.3f px RMS; pulls %.2f\n",
              fits, std::sqrt(followed / count), std::sqrt(anew / count), std::sqrt(pulls / count));
  EXPECT_GE(fits, 2);
  EXPECT_LE(fits, 10);
  EXPECT_LT(std::sqrt(followed / count), 0.05);
  EXPECT_LT(followed, 1.4 * 1.4 * anew);
  EXPECT_GT(std::sqrt(pulls / count), 0.7);
  EXPECT_LT(std::sqrt(pulls / count), 1.4);
}

// The known pattern of a blurred marker is not applied to something else in its place.
TEST(Detector, FollowsNoPatternThatIsNoLongerThere) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  const auto seen = [&](const std::string& id, int moved_px, bool finger) {
    const std::vector<PlacedMarker> marker = {
        test::placed(pinhole_vga(), {"apriltag_36h11", id}, {320.0 + moved_px, 240}, 40, 0.2, 20_deg, 0)};
    cv::Mat grey = test::image_of(pinhole_vga(), test::plain(640, 480, 200), marker,
                                  {.blur_px = 1.2, .noise_levels = 1}, rng);
    const Eigen::Vector2d at = test::true_corners(pinhole_vga(), marker[0])[0];
    if (finger)
      cv::circle(grey, {static_cast<int>(at.x()), static_cast<int>(at.y())}, 9, cv::Scalar(150), -1);
    return grey;
  };
  const auto first = detector.detect(seen("3", 0, false));
  ASSERT_EQ(first.size(), 1u);
  ASSERT_TRUE(first[0].by_pattern);
  const PatternAppearance& pattern = *first[0].by_pattern;
  std::array<Eigen::Vector2d, 4> corners_px;
  for (std::size_t i = 0; i < 4; ++i) corners_px[(i + pattern.first_corner) % 4] = first[0].corners_px[i];
  PatternFitBuffers buffers;
  const auto is_there = [&](const cv::Mat& grey) {
    return follow_pattern(grey, EdgeRefiner().light(), corners_px, pattern, nullptr, &buffers).has_value();
  };
  EXPECT_TRUE(is_there(seen("3", 1, false)));
  EXPECT_FALSE(is_there(seen("4", 0, false)));
  EXPECT_FALSE(is_there(seen("3", 0, true)));
  EXPECT_FALSE(is_there(test::plain(640, 480, 200)));
  std::vector<Detection> found;
  detector.follow(seen("3", 1, false), nullptr, first, &found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].by_pattern->age, 1);
  detector.follow(seen("4", 0, false), nullptr, first, &found);
  EXPECT_TRUE(found.empty() || found[0].marker.id == "4");
  detector.follow(test::plain(640, 480, 200), nullptr, first, &found);
  EXPECT_TRUE(found.empty());
  detector.follow(seen("3", 15, false), nullptr, first, &found);
  ASSERT_EQ(found.size(), 1u);
  const auto anew = detector.detect(seen("3", 15, false));
  for (std::size_t k = 0; k < 4; ++k) EXPECT_LT((found[0].corners_px[k] - anew[0].corners_px[k]).norm(), 0.2);
}

// Markers with the same id, 70 px wide and so steep that each lies within half a side of the next.
cv::Mat stacked_markers(int count, double moved_px, std::mt19937_64& rng) {
  std::vector<PlacedMarker> markers;
  for (int i = 0; i < count; ++i)
    markers.push_back(test::placed(pinhole_vga(), {"aruco_4x4_50", "7"}, {320, 200 + 36.0 * i + moved_px}, 70,
                                   0, 68_deg, 0));
  return test::image_of(pinhole_vga(), test::plain(640, 480, 100), markers, {.noise_levels = 1}, rng);
}

TEST(Detector, FollowsNoSquareTwice) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50"}));
  const auto last = detector.detect(stacked_markers(3, 0, rng));
  ASSERT_EQ(last.size(), 3);
  std::vector<Detection> found;
  for (const double moved_px : {0, 12, 24, 36}) {
    detector.follow(stacked_markers(3, moved_px, rng), nullptr, last, &found);
    ASSERT_FALSE(found.empty()) << moved_px;
    for (std::size_t i = 0; i < found.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_GT((found[i].corners_px[0] - found[j].corners_px[0]).norm(), 25) << moved_px;
  }
  detector.follow(stacked_markers(1, 36, rng), nullptr, last, &found);
  EXPECT_EQ(found.size(), 1);
}

}  // namespace
}  // namespace limn::tracker
