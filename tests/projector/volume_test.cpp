// Slices of volumes on caps: against closed forms, and against the ray tracer with its own interpolation.
#include "scene/volumes/volume.h"

#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "scene/volume_part.h"
#include "tests/projector/judged_image.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn::projector {
namespace {

using VolumeTest = RendererTest;
using scene::CutPlane;
using scene::GreyWindow;

// A grid that is turned, sheared and has different spacings; its middle is the part's origin.
scene::Volume volume_of(const std::function<double(const Vector3d& p)>& value, int fineness = 1) {
  scene::Volume volume;
  volume.size = {24 * fineness, 20 * fineness, 16 * fineness};
  Eigen::Matrix3d axes = Eigen::AngleAxisd(0.4, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  axes.col(2) += 0.1 * axes.col(0);
  volume.part_from_voxel.linear() = axes * Eigen::DiagonalMatrix<double, 3>(0.008, -0.009, 0.011) / fineness;
  const Vector3d middle = 0.5 * Vector3d(volume.size[0] - 1, volume.size[1] - 1, volume.size[2] - 1);
  volume.part_from_voxel.translation() = -(volume.part_from_voxel.linear() * middle);
  for (int k = 0; k < volume.size[2]; ++k)
    for (int j = 0; j < volume.size[1]; ++j)
      for (int i = 0; i < volume.size[0]; ++i)
        volume.values.push_back(static_cast<float>(value(volume.part_from_voxel * Vector3d(i, j, k))));
  return volume;
}

void add_volume(scene::Volume volume, const GreyWindow& window, scene::Slot* slot) {
  scene::Variant variant{std::string(1, static_cast<char>('a' + slot->variants.size())),
                         scene::volume_box(volume)};
  variant.volume = std::make_shared<const scene::Volume>(std::move(volume));
  variant.window = window;
  slot->variants.push_back(std::move(variant));
}

// One slot with the volumes as its variants, which the section cuts.
Scene scene_with(std::vector<std::pair<scene::Volume, GreyWindow>> volumes, Mesh prototype) {
  scene::Slot part = slot("part", scene::Mode::view, {});
  part.variants.clear();
  for (auto& [volume, window] : volumes) add_volume(std::move(volume), window, &part);
  Scene scene = scene_of(std::move(prototype), {part});
  scene.section = scene::Section{
      .marker = {"aruco_4x4_50", "9"}, .size_m = 0.04, .slots = {"part"}, .cuts_prototype = false};
  return scene;
}

// Where the ray of a pixel meets the plane, in the world.
Vector3d on_plane(const Imager& viewer, const CutPlane& plane, double x, double y) {
  const Pose world_from_viewer = viewer.imager_from_world.inverse();
  const Vector3d d =
      world_from_viewer.rotation * Vector3d((x - viewer.lens.values[2]) / viewer.lens.values[0],
                                            (y - viewer.lens.values[3]) / viewer.lens.values[1], 1);
  return world_from_viewer.translation -
         height_over(plane, world_from_viewer.translation) / plane.normal.dot(d) * d;
}

// Whether p is in the grid, `margin` voxels inside the outermost centres.
bool is_within(const scene::Volume& volume, const Vector3d& p_part, double margin) {
  const Vector3d p = volume.part_from_voxel.inverse() * p_part;
  for (int i = 0; i < 3; ++i)
    if (p[i] < margin || p[i] > volume.size[static_cast<std::size_t>(i)] - 1 - margin) return false;
  return true;
}

double ramp(const Vector3d& p) { return 100 + 2000 * p.x() - 1500 * p.y() + 1000 * p.z(); }

TEST_F(VolumeTest, ASliceOfALinearRampIsTheRamp) {
  std::mt19937_64 rng = test::test_rng();
  const GreyWindow window{120, 500};
  // The second variant lies behind another volume in the texture.
  Scene scene =
      scene_with({{volume_of([](const Vector3d&) { return 1e4; }), {0, 1}}, {volume_of(ramp), window}},
                 sheet(0.01, 0.01, 50));
  const scene::Volume& volume = *scene.slots[0].variants[1].volume;
  Renderer drawing = renderer(scene, two_projectors());
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].variant = "b";
  double worst = 0;
  int pixels = 0;
  for (int n = 0; n < 12; ++n) {
    const Pose part_from_world = posed.parts[0].world_from_part.inverse();
    Vector3d normal(test::uniform(rng, -1, 1), test::uniform(rng, -1, 1), test::uniform(rng, -1, 1));
    normal.normalize();
    posed.cut = CutPlane{
        normal, normal.dot(posed.parts[0].world_from_part.translation) + test::uniform(rng, -0.03, 0.03)};
    const Vector3d p_eye =
        posed.parts[0].world_from_part.translation + 0.8 * normal + 0.2 * normal.unitOrthogonal();
    const Imager viewer = viewer_imager(
        looking_at(p_eye, posed.parts[0].world_from_part.translation, normal.unitOrthogonal()).inverse(), 200,
        150, 30);
    const cv::Mat drawn = drawing.view(viewer, posed, cv::Scalar(0, 0, 90));
    for (int row = 0; row < drawn.rows; row += 3)
      for (int column = 0; column < drawn.cols; column += 3) {
        const Vector3d p = part_from_world * on_plane(viewer, *posed.cut, column, row);
        if (!is_within(volume, p, 0.5)) continue;
        const double wanted = 255 * std::clamp((ramp(p) - window.level) / window.width + 0.5, 0.0, 1.0);
        for (int c = 0; c < 3; ++c)
          worst = std::max(worst, std::abs(drawn.at<cv::Vec3b>(row, column)[c] - wanted));
        ++pixels;
      }
  }
  std::printf("%d pixels, worst difference %.2f levels\n", pixels, worst);
  EXPECT_GT(pixels, 5000);
  EXPECT_LT(worst, 1.5);  // rounding to 8 bits, and 8 bits of a texture unit's weights
}

TEST_F(VolumeTest, TheWindowSetsBlackGreyAndWhite) {
  Scene scene =
      scene_with({{volume_of([](const Vector3d&) { return 40.0; }), {40, 400}}}, sheet(0.01, 0.01, 50));
  Renderer drawing = renderer(scene, two_projectors());
  PosedScene posed = posed_at_origin(scene);
  posed.parts[0].world_from_part = Pose();
  posed.cut = CutPlane{{0, 0, -1}, 0};
  const Imager viewer = viewer_imager(looking_at({1e-3, 2e-3, -1}, {0, 0, 0}, k_up).inverse(), 65, 65, 3);
  const auto middle = [&] {
    return static_cast<int>(drawing.view(viewer, posed, cv::Scalar(0, 0, 90)).at<cv::Vec3b>(32, 32)[1]);
  };
  EXPECT_NEAR(middle(), 128, 1);
  posed.parts[0].window = GreyWindow{50, 20};
  EXPECT_NEAR(middle(), 0, 0);
  posed.parts[0].window = GreyWindow{30, 20};
  EXPECT_NEAR(middle(), 255, 0);
  posed.parts[0].window = GreyWindow{140, 400};
  EXPECT_NEAR(middle(), 64, 1);
  posed.parts[0].window.reset();
  EXPECT_NEAR(middle(), 128, 1);
}

// A shell in a ball, with waves, as a scan has.
double ball(const Vector3d& p) {
  const double r = p.norm() / 0.07;
  return r > 1 ? 0 : r > 0.85 ? 900 : 300 + 150 * std::sin(90 * p.x()) * std::cos(70 * p.y() + 40 * p.z());
}

TEST_F(VolumeTest, LightAndCompositesAreThoseOfTheRayTracer) {
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  JudgedRoom room =
      judged_room(std::move(rig), scene_with({{volume_of(ball, 3), {400, 1000}}}, sheet(0.5, 0.36)));
  room.posed.parts[0].world_from_part = Pose(exp_rotation({0.3, -0.2, 0.5}), {0, 0, -0.02});
  room.posed.cut = CutPlane{Vector3d(0.2, -0.25, -1).normalized(), 0.03};
  Renderer drawing = renderer(room.scene, room.rig);
  const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
  const cv::Mat drawn = composite_over_black(&drawing, room),
                lit = drawing.projector_image(0, room.posed, room.viewer);
  const auto is_seen = agree(drawn, judge.parts_image(room.rig.cameras[0]), 0, 3000),
             is_lit = agree(lit, judge.projector_image(0), 2.2, 3000);
  std::printf("composite: %s\nlight: %s\n", is_seen.message(), is_lit.message());
  EXPECT_TRUE(is_seen) << is_seen.message();
  EXPECT_TRUE(is_lit) << is_lit.message();
  cv::Scalar mean, spread;
  cv::meanStdDev(drawn, mean, spread);
  EXPECT_GT(spread[0], 10) << "no slice is seen";
  cv::imwrite((test::test_folder() / "slice.png").string(), drawn);
}

}  // namespace
}  // namespace limn::projector
