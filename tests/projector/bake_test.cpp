#include "projector/bake.h"

#include <cmath>

#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

Imager distorted() {
  Imager imager{"projector0", 1280, 800, {}, Pose()};
  imager.lens = Lens::create("LENSMODEL_OPENCV4", {1500, 1500, 660, 850, -0.12, 0.08, 0.001, -0.001}).value();
  return imager;
}

TEST(Bake, TangentsBetweenNodesAgreeWithTheLens) {
  const Imager imager = distorted();
  const BakedLens lens = baked(imager);
  auto rng = test::test_rng();
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d px(u(rng) * imager.width - 0.5, u(rng) * imager.height - 0.5);
    const Eigen::Vector2d node = (px / lens.step).cwiseMax(0);
    const int x = static_cast<int>(node.x()), y = static_cast<int>(node.y());
    const double fx = px.x() / lens.step - x, fy = px.y() / lens.step - y;
    ASSERT_LT(x + 1, lens.tangents.cols);
    ASSERT_LT(y + 1, lens.tangents.rows);
    Eigen::Vector2d found = Eigen::Vector2d::Zero();
    for (int k = 0; k < 4; ++k) {
      const auto& v = lens.tangents.at<cv::Vec2f>(y + k / 2, x + k % 2);
      found += (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy) * Eigen::Vector2d(v[0], v[1]);
    }
    EXPECT_TRUE(test::near(*imager.lens.project(found.homogeneous()), px, 0.01));
    EXPECT_TRUE((found.array() > lens.rect.lower.array()).all() &&
                (found.array() < lens.rect.upper.array()).all());
  }
}

TEST(Bake, PixelMapIsTheLens) {
  const Imager imager = distorted();
  const TangentRect rect{{-0.5, -0.6}, {0.4, 0.1}};
  const cv::Mat map = pixel_map(imager, rect, 321, 241);
  const auto& px = map.at<cv::Vec2f>(120, 160);
  EXPECT_TRUE(test::near(Eigen::Vector2d(px[0], px[1]),
                         *imager.lens.project(Eigen::Vector3d(-0.05, -0.25, 1)), 1e-3));
}

TEST(Bake, ResponseTableInvertsTheMeasuredLight) {
  ProjectorResponse response{"projector0", {}, {}, {}};
  for (int i = 0; i <= 16; ++i) {
    const double v = i / 16.0;
    response.red.push_back(v * v);
    response.green.push_back(v);
    response.blue.push_back(0.02 + 0.98 * v);
  }
  const cv::Mat table = response_table(&response, 1025);
  for (int k = 0; k < table.cols; k += 64) {
    const double light = std::pow(k / 1024.0, 2);
    const auto& entry = table.at<cv::Vec3f>(0, k);
    // Red is stored at 17 levels; between them the table is linear.
    EXPECT_NEAR(entry[0], std::sqrt(light), 0.033);
    EXPECT_NEAR(entry[1], light, 1e-5);
    EXPECT_NEAR(entry[2], std::max(0.0, (light - 0.02) / 0.98), 1e-5);
  }
  EXPECT_EQ(table.at<cv::Vec3f>(0, 1024)[0], 1);
}

TEST(Bake, WithoutAResponseTheTableIsGamma22) {
  const cv::Mat table = response_table(nullptr, 1025);
  EXPECT_NEAR(table.at<cv::Vec3f>(0, 512)[1], std::pow(0.25, 1 / 2.2), 1e-6);
}

}  // namespace
}  // namespace limn::projector
