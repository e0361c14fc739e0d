// Slices of volumes on a card: what a projector's pixels show, against the values at the points of the card
// that their exact rays meet.
#include "session/drawing/card_slice.h"

#include <cmath>
#include <cstdio>

#include "core/linear_algebra.h"
#include "scene/volume_part.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

using Eigen::Vector3d;

double ramp(const Vector3d& p) { return 1000 * p.x() + 700 * p.y() - 400 * p.z(); }

// A scene with a block of 120 x 100 x 80 mm whose values are a ramp, and a card of 150 x 100 mm.
scene::Scene scene_with_card() {
  scene::Volume volume;
  volume.size = {25, 21, 17};
  volume.part_from_voxel = Eigen::Translation3d(-0.06, -0.05, -0.04) * Eigen::Scaling(0.005);
  for (int k = 0; k < 17; ++k)
    for (int j = 0; j < 21; ++j)
      for (int i = 0; i < 25; ++i)
        volume.values.push_back(static_cast<float>(ramp(volume.part_from_voxel * Vector3d(i, j, k))));
  scene::Variant variant{"a", scene::volume_box(volume)};
  variant.volume = std::make_shared<const scene::Volume>(std::move(volume));
  variant.window = scene::GreyWindow{0, 300};
  scene::Scene scene;
  scene.prototype.emplace();
  scene.slots.emplace_back();
  scene.slots[0].name = "head";
  scene.slots[0].variants = {variant};
  scene.section = scene::Section{.marker = {"aruco_4x4_50", "9"}, .size_m = 0.03, .slots = {"head"}};
  scene.section->card_size_m = Eigen::Vector2d(0.15, 0.1);
  return scene;
}

struct Room {
  scene::Scene scene = scene_with_card();
  scene::PosedScene posed;
  Pose world_from_card{exp_rotation({0.3, -0.2, 0.4}), {0.02, 0.01, 0.9}};
  Imager projector;
};

Room room() {
  Room out;
  out.posed.world_from_prototype = Pose(exp_rotation({0.1, 0.2, 0.3}), {0.3, 0.2, 1.2});
  out.posed.parts = {{"head", "a", Pose(exp_rotation({-0.2, 0.5, 0.1}), {0, 0, 0.9})}};
  out.projector.width = 1280;
  out.projector.height = 800;
  out.projector.lens =
      Lens::create("LENSMODEL_OPENCV5", {1800, 1800, 639.5, 399.5, -0.1, 0.05, 0.001, -0.001, 0.01}).value();
  return out;
}

cv::Mat drawn(const Room& room, const std::vector<projector::Overlay>& overlays, std::size_t projector) {
  cv::Mat image(room.projector.height, room.projector.width, CV_8UC3, cv::Scalar::all(77));
  projector::draw(overlays, {projector, room.projector, room.posed, &image});
  return image;
}

// Where a pixel's ray meets the card, in its frame.
Vector3d on_card(const Room& room, int column, int row) {
  const Pose card_from_projector = (room.projector.imager_from_world * room.world_from_card).inverse();
  const Vector3d d = card_from_projector.rotation *
                     room.projector.lens.unproject({column, row})->normalized(),
                 p = card_from_projector.translation;
  return p - p.z() / d.z() * d;
}

TEST(CardSlice, ThePixelsOfOneProjectorShowTheValuesWhereTheirRaysMeetTheCard) {
  const Room in = room();
  const auto overlays = card_overlays(in.scene, in.posed, in.world_from_card, 1, 3);
  const cv::Mat lit = drawn(in, overlays, 1), dark = drawn(in, overlays, 0);
  const Pose part_from_card = in.posed.parts[0].world_from_part.inverse() * in.world_from_card;
  int within = 0, beside = 0, not_dark = 0;
  double worst = 0;
  for (int row = 0; row < lit.rows; row += 2)
    for (int column = 0; column < lit.cols; column += 2) {
      const Vector3d p_card = on_card(in, column, row);
      const double edge_m = std::min(0.075 - std::abs(p_card.x()), 0.05 - std::abs(p_card.y()));
      if (edge_m < -1e-3) {
        beside += lit.at<cv::Vec3b>(row, column) != cv::Vec3b::all(77);
        continue;
      }
      if (edge_m < 1e-3) continue;
      not_dark += dark.at<cv::Vec3b>(row, column) != cv::Vec3b::all(0);
      const Vector3d p_part = part_from_card * p_card;
      if (!((p_part.array().abs() < Eigen::Array3d(0.058, 0.048, 0.038)).all())) continue;
      const double wanted = 255 * std::clamp(0.5 + ramp(p_part) / 300, 0.0, 1.0);
      worst = std::max(worst, std::abs(lit.at<cv::Vec3b>(row, column)[0] - wanted));
      ++within;
    }
  std::printf("%d pixels on the card, worst difference %.2f levels\n", within, worst);
  EXPECT_GT(within, 5000);
  EXPECT_LT(worst, 2.0);  // 1 mm along the ramp is at most 1.1 levels; 0.5 for rounding
  EXPECT_EQ(beside, 0);
  EXPECT_EQ(not_dark, 0) << "another projector lights the card";
}

TEST(CardSlice, TheChosenWindowIsShownAndOutsideOfTheVolumeTheCardIsDark) {
  Room in = room();
  in.posed.parts[0].window = scene::GreyWindow{-1e6, 1};
  const auto bright = drawn(in, card_overlays(in.scene, in.posed, in.world_from_card, 0, 1), 0);
  const auto px = in.projector.project(in.world_from_card.translation);
  ASSERT_TRUE(px);
  const cv::Point middle(static_cast<int>(px->x()), static_cast<int>(px->y()));
  EXPECT_EQ(bright.at<cv::Vec3b>(middle), cv::Vec3b::all(255));
  in.posed.parts[0].world_from_part.translation.x() += 1;
  const auto away = drawn(in, card_overlays(in.scene, in.posed, in.world_from_card, 0, 1), 0);
  EXPECT_EQ(away.at<cv::Vec3b>(middle), cv::Vec3b::all(0));
}

TEST(CardSlice, WithoutCardVolumeOrPrototypeThereIsNone) {
  Room in = room();
  in.posed.world_from_prototype.reset();
  EXPECT_TRUE(card_overlays(in.scene, in.posed, in.world_from_card, 0, 2).empty());
  in = room();
  in.scene.section->card_size_m.reset();
  EXPECT_TRUE(card_overlays(in.scene, in.posed, in.world_from_card, 0, 2).empty());
  in = room();
  in.scene.section->slots.clear();
  EXPECT_TRUE(card_overlays(in.scene, in.posed, in.world_from_card, 0, 2).empty());
}

}  // namespace
}  // namespace limn::session
