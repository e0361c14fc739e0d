// The code of the remote in a projector's light.
#include "remote/pairing_overlay.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "device/gl_context.h"
#include "device/gui/qr_code.h"
#include "session/perception.h"
#include "session/session.h"
#include "sim/virtual_rig.h"
#include "tests/remote/virtual_tablet.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;

const std::string k_text = "https://192.168.107.12:8443/#pin=123456";

// The share of a code's modules that a camera sees otherwise than they are, where it sees the sign's corners.
double misread(const cv::Mat& seen, const cv::Mat& sign, const std::array<cv::Point2f, 4>& corners) {
  const cv::Mat code = gui::qr_code(k_text);
  const float width = static_cast<float>(code.cols),
              height = width * static_cast<float>(sign.rows) / static_cast<float>(sign.cols);
  const std::array<cv::Point2f, 4> from = {{{0, 0}, {width, 0}, {width, height}, {0, height}}};
  cv::Mat grey, flat;
  cv::cvtColor(seen, grey, cv::COLOR_BGR2GRAY);
  constexpr int k_px = 10;  // of a module
  const cv::Mat larger = cv::Mat::diag(cv::Mat(cv::Vec3d(k_px, k_px, 1)));
  cv::warpPerspective(grey, flat, larger * cv::getPerspectiveTransform(corners.data(), from.data()),
                      code.size() * k_px);
  cv::blur(flat, flat, {k_px / 2, k_px / 2});
  cv::Mat around;
  cv::blur(flat, around, {9 * k_px, 9 * k_px});  // as readers do: the threshold is the neighbourhood's
  int wrong = 0, count = 0;
  for (int y = 4; y < code.rows - 4; ++y)
    for (int x = 4; x < code.cols - 4; ++x, ++count) {
      const cv::Point at(x * k_px + k_px / 2, y * k_px + k_px / 2);
      wrong += (flat.at<std::uint8_t>(at) > around.at<std::uint8_t>(at)) != (code.at<std::uint8_t>(y, x) > 0);
    }
  return 1.0 * wrong / count;
}

// On the door, which is curved and has markers all over.
TEST(CodeSign, IsReadOnThePrototype) {
  const fs::path folder = test::test_folder();
  sim::World world = test::studio_world();
  const device::GlContext context = device::GlContext::create().value();
  sim::VirtualRig rig(world, {.grab_waits_for_light = false});
  const session::SessionSetup setup{world.rig, *world.scene, {}, {}};
  session::Perception perception = session::Perception::create(setup.scene, setup.rig).value();
  session::Session session = session::Session::create(setup, nullptr, nullptr, false).value();
  const int camera = 0;
  std::vector<cv::Mat> light;
  for (std::size_t i = 1; i <= 2; ++i) {
    session.update_percepts(perception.watch(rig.expose(std::span(&camera, 1))), i);
    light = session.compose_and_record(rig.now(), shifted(rig.now(), 0.03)).projectors;
  }
  ASSERT_TRUE(session.composed().posed.world_from_prototype.has_value());
  const Pose world_from_prototype = *session.composed().posed.world_from_prototype;
  const cv::Mat sign = 0.75 * pairing_code_image(k_text, "123456", "work", 12);
  const cv::Mat points = session.free_surface(0);
  const Eigen::Vector3d d_up = world_from_prototype.rotation.inverse() * Eigen::Vector3d::UnitZ();
  const auto begun = std::chrono::steady_clock::now();
  const auto place =
      overlay_place(setup.rig.projectors[0], world_from_prototype, points, d_up, sign.size(), 70);
  const double ms = 1e3 * seconds_between(begun, std::chrono::steady_clock::now());
  ASSERT_TRUE(place.has_value());
  light[0] = light[0].clone();
  projector::draw_pairing_overlay(sign, *place, setup.rig.projectors[0], world_from_prototype, &light[0]);
  ASSERT_TRUE(write_png(folder / "light.png", light[0]));
  const Eigen::Vector3d p_middle =
      world_from_prototype * (place->p_corner + 0.5 * (place->d_right + place->d_down));
  test::VirtualTablet phone(world, light, 1280, 800, 3);
  const test::TabletShot shot =
      phone.shoot_from(looking_at(p_middle + Eigen::Vector3d(0.1, -0.45, 0.1), p_middle, {0, 0, 1}));
  ASSERT_TRUE(write_png(folder / "seen.png", shot.image));
  std::array<cv::Point2f, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d p =
        place->p_corner + (i == 1 || i == 2) * place->d_right + (i >= 2) * place->d_down;
    const Eigen::Vector2d px = *shot.camera.project(world_from_prototype * p);
    corners[i] = {static_cast<float>(px.x()), static_cast<float>(px.y())};
  }
  const double wrong = misread(shot.image, sign, corners);
  std::printf("%.0f mm wide, found in %.0f ms, %.1f %% of its modules misread; %s\n",
              1e3 * place->d_right.norm(), ms, 100 * wrong, folder.c_str());
  EXPECT_LT(wrong, 0.02);  // the code is read with 15 % of them wrong
  // A PIN alone finds room where the code does not.
  const cv::Mat pin = pin_image("123456", "work", 360);
  EXPECT_FALSE(overlay_place(setup.rig.projectors[0], world_from_prototype, points, d_up, sign.size(), 110));
  const auto wide =
      overlay_place(setup.rig.projectors[0], world_from_prototype, points, d_up, pin.size(), 110);
  ASSERT_TRUE(wide.has_value());
  cv::Mat alone(light[0].size(), CV_8UC3, cv::Scalar::all(0));
  projector::draw_pairing_overlay(pin, *wide, setup.rig.projectors[0], world_from_prototype, &alone);
  ASSERT_TRUE(write_png(folder / "pin.png", alone));
  EXPECT_GT(cv::countNonZero(alone.reshape(1)), 3 * 110 * 40 / 2);
  // It would not be on the door.
  EXPECT_FALSE(overlay_place(setup.rig.projectors[0], world_from_prototype, points, d_up, sign.size(), 600));
}

}  // namespace
}  // namespace limn::remote
