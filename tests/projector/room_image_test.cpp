// A picture of the room as light, against the ray tracer, which samples the picture itself.
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/photometric_response.h"
#include "core/scale_resolution.h"
#include "tests/projector/judged_image.h"

namespace limn::projector {
namespace {

using RoomImageTest = RendererTest;

constexpr double k_width = 0.5, k_height = 0.36, k_bow = 0.09;  // m

// A panel that is bowed about both axes, so that it mirrors a large part of the room.
Mesh bowed_panel() {
  const auto bowed = [](double u, double v) {
    return Vector3d(k_width * (u - 0.5), k_height * (v - 0.5),
                    k_bow * (std::pow(2 * u - 1, 2) + std::pow(2 * v - 1, 2)));
  };
  Mesh mesh = grid(60, 60, bowed);
  mesh.normals.clear();
  for (const auto& p : mesh.positions) {
    const Eigen::Vector2f slope = 8 * static_cast<float>(k_bow) *
                                  Eigen::Vector2f(p.x() / static_cast<float>(k_width * k_width),
                                                  p.y() / static_cast<float>(k_height * k_height));
    mesh.normals.push_back(Eigen::Vector3f(slope.x(), slope.y(), -1).normalized());
  }
  return mesh;
}

// A room: a bright ceiling, a dark floor, a window, a lamp 30 times as bright as the walls, a red wall.
cv::Mat studio() {
  cv::Mat light(256, 512, CV_32FC3);
  for (int row = 0; row < light.rows; ++row)
    for (int column = 0; column < light.cols; ++column) {
      const float down = (static_cast<float>(row) + 0.5F) / 256,
                  across = (static_cast<float>(column) + 0.5F) / 512;
      cv::Vec3f& pixel = light.at<cv::Vec3f>(row, column);
      pixel =
          down < 0.5F ? cv::Vec3f(0.3F, 0.28F, 0.25F) * (1.4F - 1.2F * down) : cv::Vec3f(0.06F, 0.07F, 0.09F);
      if (across > 0.75F && down > 0.3F && down < 0.6F) pixel = {0.05F, 0.05F, 0.4F};
      if (std::abs(across - 0.4F) < 0.05F && std::abs(down - 0.38F) < 0.09F) pixel = {2.2F, 2, 1.8F};
      if (std::abs(across - 0.6F) < 0.02F && std::abs(down - 0.3F) < 0.03F) pixel = {6, 6.5F, 7};
    }
  return light;
}

JudgedRoom room_of(double metallic, double roughness, double coat) {
  Rig rig = two_projectors();
  rig.projectors.pop_back();
  EXPECT_TRUE(scale_resolution(0.2, &rig));
  Scene scene = scene_of(bowed_panel(), {});
  scene::Finish finish;
  finish.name = "paint";
  finish.base_colour = {0.75, 0.6, 0.5};
  finish.metallic = metallic;
  finish.roughness = roughness;
  finish.clearcoat = coat;
  finish.clearcoat_roughness = 0.1;
  finish.for_viewer = true;
  scene.finishes = {finish};
  scene.light = scene::RoomLight{k_up, Vector3d::Zero(), Vector3d::Zero(), {}, 0.8};
  scene.room_image.emplace();
  scene.room_image->light = studio();
  // The middle of the picture is behind the viewer, whose right is -x there.
  scene.room_image->image_from_world << -1, 0, 0, 0, -1, 0, 0, 0, -1;
  JudgedRoom room = judged_room(std::move(rig), std::move(scene), {-0.25, -0.3, -1.2});
  room.posed.finish = "paint";
  return room;
}

// The structural similarity (Wang et al. 2004) of two sRGB images, the mean over channels and the pixels of a
// mask: Gaussian windows of 11 x 11 pixels.
double similarity(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  const auto blurred = [](const cv::Mat& image) {
    cv::Mat out;
    cv::GaussianBlur(image, out, {11, 11}, 1.5);
    return out;
  };
  cv::Mat x, y;
  a.convertTo(x, CV_32F);
  b.convertTo(y, CV_32F);
  constexpr double k_c1 = 6.5025, k_c2 = 58.5225;  // (0.01 x 255)^2 and (0.03 x 255)^2
  const cv::Mat mx = blurred(x), my = blurred(y), mxx = mx.mul(mx), myy = my.mul(my), mxy = mx.mul(my);
  const cv::Mat vx = blurred(x.mul(x)) - mxx, vy = blurred(y.mul(y)) - myy, vxy = blurred(x.mul(y)) - mxy;
  const auto plus = [](const cv::Mat& m, double c) { return cv::Mat(m + cv::Scalar::all(c)); };
  cv::Mat ssim;
  cv::divide(plus(2 * mxy, k_c1).mul(plus(2 * vxy, k_c2)), plus(mxx + myy, k_c1).mul(plus(vx + vy, k_c2)),
             ssim);
  const cv::Scalar mean = cv::mean(ssim, mask);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

// What the judge says, encoded: gamma 0 is sRGB.
cv::Mat encoded(const sim::PartImage& judged, double gamma) {
  cv::Mat out(judged.light.size(), CV_8UC3);
  for (int row = 0; row < out.rows; ++row)
    for (int column = 0; column < out.cols; ++column)
      for (int c = 0; c < 3; ++c) {
        const auto light =
            std::clamp(static_cast<double>(judged.light.at<cv::Vec3f>(row, column)[c]), 0.0, 1.0);
        out.at<cv::Vec3b>(row, column)[c] = cv::saturate_cast<std::uint8_t>(
            255 * (gamma > 0 ? std::pow(light, 1 / gamma) : srgb_from_linear(light)));
      }
  return out;
}

double similarity(const cv::Mat& drawn, const sim::PartImage& judged, double gamma) {
  cv::Mat inside = judged.cover >= 1;
  cv::erode(inside, inside, cv::Mat::ones(11, 11, CV_8U));
  EXPECT_GT(cv::countNonZero(inside), 600);
  return similarity(drawn, encoded(judged, gamma), inside);
}

TEST_F(RoomImageTest, IsReflectedAtFiveRoughnessesAsTheRayTracerSays) {
  for (const double roughness : {0.05, 0.25, 0.45, 0.7, 1.0}) {
    const JudgedRoom room = room_of(1, roughness, 0);
    Renderer drawing = renderer(room.scene, room.rig);
    const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
    const double seen =
        similarity(composite_over_black(&drawing, room), judge.parts_image(room.rig.cameras[0]), 0);
    fmt::print("roughness {:.2f}: SSIM {:.4f} in composites\n", roughness, seen);
    EXPECT_GE(seen, 0.98) << roughness;
  }
  for (const double roughness : {0.25, 0.7}) {
    const JudgedRoom room = room_of(1, roughness, 0);
    Renderer drawing = renderer(room.scene, room.rig);
    const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
    const double lit =
        similarity(drawing.projector_image(0, room.posed, room.viewer), judge.projector_image(0), 2.2);
    fmt::print("roughness {:.2f}: SSIM {:.4f} in light\n", roughness, lit);
    EXPECT_GE(lit, 0.98) << roughness;
  }
}

TEST_F(RoomImageTest, LightsPaintWithAClearLayerAsTheRayTracerSays) {
  const JudgedRoom room = room_of(0, 0.6, 1);
  Renderer drawing = renderer(room.scene, room.rig);
  const sim::ReferenceRenderer judge(room.world, room.posed, room.viewer);
  EXPECT_GE(similarity(drawing.projector_image(0, room.posed, room.viewer), judge.projector_image(0), 2.2),
            0.98);
}

TEST_F(RoomImageTest, ALooksLightDecidesHowStrongItIs) {
  JudgedRoom room = room_of(0, 1, 0);
  Renderer drawing = renderer(room.scene, room.rig);
  const auto mean = [&] { return cv::mean(drawing.projector_image(0, room.posed, room.viewer))[1]; };
  const double own = mean();
  room.posed.light = room.scene.light;
  room.posed.light->image_strength = 0;
  EXPECT_EQ(mean(), 0);
  room.posed.light->image_strength = 0.2;
  const double weak = mean();
  EXPECT_GT(weak, 0);
  EXPECT_LT(weak, 0.7 * own);
}

}  // namespace
}  // namespace limn::projector
