#include "limn/renderer.h"

#include <epoxy/egl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <thread>

#include "device/gl_context.h"
#include "library/convert.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"
#include "tests/library/example_inputs.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

namespace api = LIMN_VERSIONED;

const char* const k_door = LIMN_SOURCE_DIR "/config/scenes/door";

class LibraryRenderer : public testing::Test {
 protected:
  void SetUp() override {
    folder = test::test_folder();
    test::write_example_scene(folder);
  }
  api::Scene scene = api::Scene::load(k_door);
  std::filesystem::path folder;
};

TEST_F(LibraryRenderer, DrawsWhatTheProgramDraws) {
  const api::Rig rig = api::Rig::load(folder / "rig");
  const api::PosedScene posed = scene.load_poses(folder / "poses.json");
  const api::Imager viewer = scene.viewer(posed, rig);
  api::Image light,
      behind{.pixels = std::vector<std::uint8_t>(3 * 640 * 480, 90), .width = 640, .height = 480};
  api::Image composite,
      padded{.pixels = std::vector<std::uint8_t>(3 * 700 * 480, 7), .width = 640, .height = 480};
  {
    api::Renderer renderer(scene, rig);
    EXPECT_NE(renderer.gl_description().find("4."), std::string::npos) << renderer.gl_description();
    light = renderer.draw_projector(0, posed, viewer);
    composite = renderer.draw_composite(0, behind.view(), posed, api::Composite::full);
    renderer.draw_projector(0, posed, viewer, {padded.pixels.data(), 640, 480, 2100, api::PixelFormat::rgb});
  }
  const Rig room_rig = load_rig(folder / "rig").value();
  const scene::Scene room = scene::load_usable_scene(k_door).value();
  const scene::PosedScene room_posed = scene::load_poses(folder / "poses.json", room).value();
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto renderer = projector::Renderer::create(room, room_rig).value();
  const cv::Mat image = renderer.projector_image(0, room_posed, api::to_room(viewer));
  EXPECT_GT(cv::countNonZero(image.reshape(1)), 1000);
  EXPECT_EQ(light.pixels, api::rgb_of(image).pixels);
  EXPECT_TRUE(std::equal(light.pixels.begin(), light.pixels.begin() + 1920, padded.pixels.begin()));
  EXPECT_EQ(padded.pixels[1920], 7) << "written between the rows";
  const cv::Mat over(480, 640, CV_8UC3, cv::Scalar(90, 90, 90));
  EXPECT_EQ(composite.pixels,
            api::rgb_of(renderer.composite(0, over, room_posed, projector::Composite::full)).pixels);
}

TEST_F(LibraryRenderer, DrawsInTheCallersContext) {
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  const api::Rig rig = api::Rig::load(folder / "rig");
  const api::PosedScene posed = scene.load_poses(folder / "poses.json");
  api::Renderer renderer(scene, rig, {.context = api::GlContext::current});
  EXPECT_GT(renderer.draw_projector_texture(0, posed, scene.viewer(posed, rig)), 0U);
  EXPECT_EQ(renderer.gl_description(), "");
}

TEST_F(LibraryRenderer, LeavesTheThreadsContextAndMayBeUsedByAnotherThread) {
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  const void* const before = eglGetCurrentContext();
  const api::Rig rig = api::Rig::load(folder / "rig");
  const api::PosedScene posed = scene.load_poses(folder / "poses.json");
  std::optional<api::Renderer> renderer(std::in_place, scene, rig);
  const api::Image here = renderer->draw_view(rig.cameras()[0], posed);
  EXPECT_EQ(eglGetCurrentContext(), before);
  std::thread([&] {
    EXPECT_EQ(renderer->draw_view(rig.cameras()[0], posed).pixels, here.pixels);
    renderer.reset();
    EXPECT_EQ(eglGetCurrentContext(), EGL_NO_CONTEXT);
    // A program that uses OpenGL ES in this thread.
    eglBindAPI(EGL_OPENGL_ES_API);
    const api::Renderer another(scene, rig);
    EXPECT_EQ(eglQueryAPI(), static_cast<EGLenum>(EGL_OPENGL_ES_API));
  }).join();
  EXPECT_EQ(eglGetCurrentContext(), before);
}

TEST_F(LibraryRenderer, SaysWhatItRefuses) {
  const api::Rig rig = api::Rig::load(folder / "rig");
  api::PosedScene posed = scene.load_poses(folder / "poses.json");
  const api::Imager viewer = rig.cameras()[0];
  api::Renderer renderer(scene, rig);
  EXPECT_THROW(renderer.draw_projector(1, posed, viewer), api::Error);
  api::Image small{.pixels = std::vector<std::uint8_t>(300), .width = 10, .height = 10};
  EXPECT_THROW(renderer.draw_projector(0, posed, viewer, small.view()), api::Error);
  EXPECT_THROW(renderer.draw_composite(0, small.view(), posed, api::Composite::rest), api::Error);
  EXPECT_THROW(renderer.draw_projector_texture(0, posed, viewer), api::Error);
  EXPECT_THROW(renderer.draw_view(api::Imager(api::ImagerParts{.name = "no size"}), posed), api::Error);
  const std::vector<api::Imager> without_size = {api::Imager(api::ImagerParts{.name = "no size"})};
  EXPECT_THROW(api::Renderer(scene, api::Rig({}, without_size)), api::Error);
  posed.parts[0].variant = "none";
  EXPECT_THROW(renderer.draw_projector(0, posed, viewer), api::Error);
  EXPECT_THROW(api::Scene::load(folder / "none"), api::Error);
}

TEST_F(LibraryRenderer, ScenesArePosedByTracks) {
  EXPECT_TRUE(scene.has_prototype());
  const auto slots = scene.slots();
  ASSERT_FALSE(slots.empty());
  EXPECT_FALSE(slots[0].variants.empty());
  const std::vector<api::Body> bodies = scene.bodies();
  EXPECT_EQ(bodies[0].name, "prototype");
  api::Track track{.body = "prototype"};
  track.world_from_body.translation = {1, 2, 3};
  const api::PosedScene posed = scene.posed({&track, 1});
  ASSERT_TRUE(posed.world_from_prototype);
  EXPECT_EQ(posed.world_from_prototype->translation, (api::Point3{1, 2, 3}));
  EXPECT_TRUE(posed.parts.empty());
  EXPECT_FALSE(scene.families().empty());
}

}  // namespace
}  // namespace limn
