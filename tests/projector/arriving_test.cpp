// Light that somebody's shadow keeps from the prototype, and how others give it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "projector/renderer.h"
#include "tests/projector/gl_test.h"

namespace limn::projector {
namespace {

using Eigen::Vector3d;

scene::Mesh sheet(double width, double height) {
  scene::Mesh mesh;
  for (const auto& [x, y] : {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
    mesh.positions.push_back(Vector3d(x * width, y * height, 0).cast<float>());
    mesh.normals.emplace_back(0, 0, -1);
  }
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh.triangle_materials = {0, 0};
  return mesh;
}

class ArrivingTest : public test::GlTest {};

TEST_F(ArrivingTest, OthersGiveTheLightOfABlockedProjector) {
  // Side by side, so that a point's pixel in one is 320 pixels beside that in the other.
  constexpr int k_shift = 320;
  Rig rig;
  for (const double x : {-0.2, 0.2}) {
    rig.projectors.push_back({x < 0 ? "projector0" : "projector1", 640, 400,
                              Lens::pinhole(800, 800, 320, 200),
                              Pose(Eigen::Quaterniond::Identity(), -Vector3d(x, 0, -1))});
  }
  scene::Scene scene;
  scene.prototype = scene::Prototype{sheet(1.1, 0.7), {}, 0.8, {}};
  const scene::PosedScene posed{Pose(), {}};
  auto drawing = Renderer::create(scene, rig);
  ASSERT_TRUE(drawing) << drawing.message();
  const cv::Mat before = drawing->blend(0, posed);

  // Rows above are blocked, rows below are free, between them it changes over one of 20 cells.
  cv::Mat map(20, 8, CV_8U, cv::Scalar(255));
  map.rowRange(0, 10).setTo(0);
  drawing->set_arriving(0, map);
  const cv::Mat own = drawing->blend(0, posed), other = drawing->blend(1, posed);
  constexpr int k_cell = 400 / 20, k_half_ramp = k_cell / 2;
  int blocked = 0, alone = 0;
  for (int row = 0; row < own.rows; ++row) {
    for (int column = 0; column < own.cols; ++column) {
      const float share = own.at<cv::Vec2f>(row, column)[0], full = before.at<cv::Vec2f>(row, column)[0];
      if (full == 0) continue;  // beside the sheet
      if (column < k_shift) {
        EXPECT_NEAR(share, 1, 1e-6) << row << " " << column;  // nobody else reaches
        ++alone;
        continue;
      }
      const float rest = other.at<cv::Vec2f>(row, column - k_shift)[0];
      const bool reached_well = 1 - full > 0.02F;  // not at the very border of the other's picture
      if (row < 200 - k_half_ramp && reached_well) {
        EXPECT_GT(rest, 0.94F) << row << " " << column;
        EXPECT_NEAR(share, std::max(0.08F * full, 1 - rest), 1e-4) << row << " " << column;
        ++blocked;
      } else if (row >= 200 + k_half_ramp) {
        EXPECT_NEAR(share, full, 1e-3) << row << " " << column;
      }
      EXPECT_LT(share + rest, 1.08F);  // no flash when the shadow goes
      EXPECT_GT(share + rest, 0.998F);
      const float above = row > 100 && row < 300 ? own.at<cv::Vec2f>(row - 1, column)[0] : share;
      EXPECT_LT(std::abs(share - above), 0.12F) << row << " " << column;
    }
  }
  EXPECT_GT(blocked, 30000);
  EXPECT_GT(alone, 50000);

  drawing->set_arriving(0, {});
  EXPECT_EQ(cv::norm(cv::Mat(drawing->blend(0, posed)), before, cv::NORM_INF), 0);
}

}  // namespace
}  // namespace limn::projector
