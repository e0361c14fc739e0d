// Markers under projected content, in the virtual rig.

#include "tracker/projected_light.h"

#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <set>

#include "sim/sensor_model.h"
#include "sim/trace.h"
#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"
#include "tracker/detector.h"
#include "tracker/family.h"
#include "tracker/marker_pose.h"

namespace limn::tracker {
namespace {

constexpr int k_columns = 5, k_rows = 3;
constexpr double k_size_m = 0.05, k_gamma = 2.2;

// A wall with markers, camera and projector with all their effects; the projector outshines the room.
sim::World lit_wall(double ambient) {
  sim::World world = test::small_world(1.0);
  Imager& camera = world.rig.cameras[0];
  camera.width = 960, camera.height = 720;
  camera.lens = Lens::pinhole(1000, 1000, 479.5, 359.5);
  Imager& projector = world.rig.projectors[0];
  projector.width = 800, projector.height = 600;
  projector.lens = Lens::create("LENSMODEL_OPENCV4", {880, 884, 392, 300, -0.05, 0.01, 1e-4, 2e-4}).value();
  world.room.ambient = ambient;
  sim::CameraEffects& sensor = world.camera_effects[0];
  sensor.exposure = 0.8 / (1 + ambient);
  sensor.psf_px = 0.6;
  sensor.full_well_e = 10000;
  sensor.read_noise = 1;
  world.projector_effects[0].gamma = k_gamma;
  const sim::MarkerImage image = [](const MarkerName& name) { return draw_marker(name, 16); };
  for (int i = 0; i < k_columns * k_rows; ++i) {
    const Pose on_wall = test::facing_minus_y(0.13 * (i % k_columns - 2), 0.999, 0.14 * (i / k_columns - 1));
    const Pose turned = on_wall * Pose(exp_rotation({0, 0, 0.3 * i}), {0, 0, 0});
    const BodyMarker marker = {{"aruco_4x4_50", std::to_string(i)}, k_size_m, turned};
    EXPECT_TRUE(sim::add_marker(world, marker, false, image));
  }
  return world;
}

// What a designer might show: stripes, checks, blobs, writing.
std::vector<std::pair<std::string, cv::Mat>> contents(const cv::Size& size, std::mt19937_64& rng) {
  const auto whole = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(rng); };
  cv::Mat stripes(size, CV_8UC1), checks(size, CV_8UC1), blobs(size, CV_8UC1, cv::Scalar(60)),
      writing(size, CV_8UC1, cv::Scalar(255));
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      stripes.at<std::uint8_t>(y, x) = (x + y) / 9 % 2 ? 255 : 70;
      checks.at<std::uint8_t>(y, x) = (x / 22 + y / 22) % 2 ? 255 : 40;
    }
  for (int i = 0; i < 300; ++i)
    cv::circle(blobs, {whole(0, size.width), whole(0, size.height)}, whole(4, 40), cv::Scalar(whole(0, 255)),
               -1, cv::LINE_AA);
  for (int i = 0; i < 90; ++i)
    cv::putText(writing, "Limn 2026", {whole(-40, size.width), whole(0, size.height)},
                cv::FONT_HERSHEY_SIMPLEX, 0.3 + 0.01 * whole(0, 120), cv::Scalar(whole(0, 120)), whole(1, 4),
                cv::LINE_AA);
  return {{"stripes", stripes}, {"checks", checks}, {"blobs", blobs}, {"writing", writing}};
}

cv::Mat light_of(const cv::Mat& shown) {
  cv::Mat share, light;
  shown.convertTo(share, CV_32F, 1 / 255.0);
  cv::pow(share, k_gamma, light);
  return light;
}

struct Found {
  int right = 0, wrong = 0;
  double squares = 0;  // of corner errors
};

void count(const std::vector<Detection>& detections, const sim::World& world, Found* found) {
  std::set<std::string> seen;
  for (const Detection& detection : detections) {
    const auto pose = sim::world_from_marker(world, detection.marker);
    double worst = 0, squares = 0;
    const auto corners = square_corners(k_size_m);
    for (std::size_t i = 0; pose && i < 4; ++i) {
      const double off = (*world.rig.cameras[0].project(*pose * corners[i]) - detection.corners_px[i]).norm();
      worst = std::max(worst, off);
      squares += off * off;
    }
    const bool right = pose && worst < 3 && seen.insert(detection.marker.id).second;
    ++(right ? found->right : found->wrong);
    if (right) found->squares += squares;
  }
}

// Everything found with the light discounted by a wall that is `off_m` behind where it truly is.
struct Recall {
  Found plain, aware;
  int markers = 0;
};

Recall recall_under_content(double off_m, std::mt19937_64& rng) {
  Recall recall;
  for (const double ambient : {0.5, 0.15}) {
    const sim::World world = lit_wall(ambient);
    const sim::Samples samples = sim::trace(world, 0);
    const Imager &camera = world.rig.cameras[0], &projector = world.rig.projectors[0];
    const Plate wall = {test::facing_minus_y(0, 1 + off_m, 0), {2, 2}};
    const cv::Mat points = points_seen(camera, std::span(&wall, 1));
    const std::vector<std::string> family = {"aruco_4x4_50"};
    Detector detector(Families::load(family).value());
    for (const auto& [name, shown] : contents({projector.width, projector.height}, rng)) {
      const cv::Mat grey = sim::photograph(world, samples, std::span(&shown, 1), rng());
      const ShownLight light = {&projector, light_of(shown)};
      const Discounted even = discounted(grey, light_seen(camera, points, std::span(&light, 1)));
      const int before = recall.plain.right, after = recall.aware.right;
      count(detector.detect(grey, &camera.lens), world, &recall.plain);
      count(detector.detect(even.grey, &camera.lens), world, &recall.aware);
      recall.markers += k_columns * k_rows;
      std::printf("room %.2f, %-8s: %2d of %d as photographed, %2d with the light discounted (gain %.2f)\n",
                  ambient, name.c_str(), recall.plain.right - before, k_columns * k_rows,
                  recall.aware.right - after, even.gain);
    }
  }
  std::printf("surface known within %.0f mm: recall %.3f -> %.3f, wrong %d -> %d, corners %.2f px\n",
              1e3 * off_m, 1.0 * recall.plain.right / recall.markers,
              1.0 * recall.aware.right / recall.markers, recall.plain.wrong, recall.aware.wrong,
              std::sqrt(recall.aware.squares / (4 * recall.aware.right)));
  return recall;
}

TEST(ProjectedLight, DiscountedFindsMarkersThatContentHides) {
  auto rng = test::test_rng();
  const Recall exact = recall_under_content(0, rng);
  EXPECT_GT(exact.aware.right, 0.95 * exact.markers);
  EXPECT_GT(exact.aware.right, exact.plain.right);
  EXPECT_EQ(exact.aware.wrong, 0);
  const Recall off = recall_under_content(0.002, rng);
  EXPECT_GT(off.aware.right, off.plain.right);
  EXPECT_EQ(off.aware.wrong, 0);
}

TEST(ProjectedLight, IsForetoldAsTheVirtualRigSeesIt) {
  sim::World world = test::small_world(1.0);
  world.objects[0].albedo.setConstant(1);
  const sim::Samples samples = sim::trace(world, 0);
  cv::Mat shown(150, 200, CV_8UC1);
  for (int y = 0; y < shown.rows; ++y)
    for (int x = 0; x < shown.cols; ++x)
      shown.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(128 + 100 * std::sin(0.15 * x) * std::cos(0.11 * y));
  const cv::Mat truth = sim::ideal_light(world, samples, std::span(&shown, 1));
  const Plate wall = {test::facing_minus_y(0, 1, 0), {2, 2}};
  cv::Mat light;
  shown.convertTo(light, CV_32F, 1 / 255.0);
  const ShownLight source = {&world.rig.projectors[0], light};
  const Imager& camera = world.rig.cameras[0];
  const cv::Mat found =
      light_seen(camera, points_seen(camera, std::span(&wall, 1)), std::span(&source, 1), 0);
  double sum = 0, worst = 0;
  int lit = 0;
  for (int y = 20; y < truth.rows - 20; ++y)
    for (int x = 20; x < truth.cols - 20; ++x) {
      if (truth.at<float>(y, x) == 0 || found.at<float>(y, x) == 0) continue;
      const double off = std::abs(truth.at<float>(y, x) - found.at<float>(y, x));
      sum += off;
      worst = std::max(worst, off);
      ++lit;
    }
  EXPECT_GT(lit, 20000);
  EXPECT_LT(sum / lit, 0.01);
  EXPECT_LT(worst, 0.1);
}

TEST(ProjectedLight, LeavesAnImageAloneThatItDoesNotExplain) {
  cv::Mat grey(120, 160, CV_8UC1), light(120, 160, CV_32FC1);
  for (int y = 0; y < grey.rows; ++y)
    for (int x = 0; x < grey.cols; ++x) {
      grey.at<std::uint8_t>(y, x) = x / 8 % 2 ? 200 : 50;
      light.at<float>(y, x) = y / 8 % 2 ? 1.f : 0.f;
    }
  const Discounted same = discounted(grey, light);
  EXPECT_EQ(same.gain, 0);
  EXPECT_TRUE(test::image_near(same.grey, grey, 0, 0, "same"));
  EXPECT_EQ(discounted(grey, cv::Mat::zeros(grey.size(), CV_32FC1)).gain, 0);
}

}  // namespace
}  // namespace limn::tracker
