// Bad scenes, rigs and drivers: errors are named, and the program survives them.
#include <epoxy/gl.h>

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core.hpp>

#include "projector/gl.h"
#include "projector/gpu_scene.h"
#include "projector/renderer.h"
#include "scene/meshes/tangents.h"
#include "tests/projector/gl_test.h"
#include "tests/support/meshes.h"

namespace limn::projector {
namespace {

using Eigen::Vector3d;

const Vector3d k_up(0, -1, 0);

scene::Mesh sheet(double width, double height, double z) {
  scene::Mesh mesh = test::textured_sheet(width, height, z);
  mesh.materials[0].unlit = true;
  mesh.materials[0].base_colour = {0.5f, 0.5f, 0.5f};
  return mesh;
}

scene::Scene wall_and_part() {
  scene::Scene scene;
  scene.prototype = scene::Prototype{sheet(0.5, 0.4, 0), {}, 0.8, {}};
  scene::Slot slot;
  slot.name = "part";
  slot.variants.push_back({"a", sheet(0.2, 0.15, -0.03)});
  scene.slots.push_back(slot);
  return scene;
}

scene::PosedScene posed_at_origin() { return {Pose(), {{"part", "a", Pose()}}}; }

Imager viewer_from(const Vector3d& p_viewpoint, const Vector3d& p_target) {
  return viewer_imager(looking_at(p_viewpoint, p_target, k_up).inverse(), 320, 240, 35);
}

Imager projector_from(const std::string& name, const Vector3d& p_viewpoint, const Vector3d& p_target) {
  return {name, 320, 200, Lens::pinhole(450, 450, 159.5, 99.5), looking_at(p_viewpoint, p_target, k_up)};
}

Rig one_projector() {
  Rig rig;
  rig.cameras = {{"camera0", 320, 240, Lens::pinhole(450, 450, 159.5, 119.5),
                  looking_at({0, -0.2, -1}, {0, 0, 0}, k_up)}};
  rig.projectors = {projector_from("projector0", {-0.2, -0.1, -1}, {0, 0, 0})};
  return rig;
}

int brightest(const cv::Mat& image) {
  double most = 0;
  cv::minMaxLoc(image.reshape(1), nullptr, &most);
  return static_cast<int>(most);
}

class BadInput : public test::GlTest {
 protected:
  static Renderer renderer(const scene::Scene& scene, const Rig& rig) {
    auto made = Renderer::create(scene, rig);
    if (!made) throw std::runtime_error(made.message());
    return std::move(made).value();
  }
  void TearDown() override { EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR)); }
};

TEST_F(BadInput, AGraphicsCardThatIsFullIsNamed) {
  forget_gl_errors();
  EXPECT_TRUE(check_gl_memory("the scene"));
  const GlName larger_than_any = make_buffer(nullptr, std::size_t{1} << 50);
  const Status checked = check_gl_memory("the scene");
  ASSERT_FALSE(checked);
  const std::string expected =
      "the scene: expected room in the graphics card's memory, found none (GL_OUT_OF_MEMORY";
  EXPECT_EQ(checked.message().substr(0, expected.size()), expected);
  glEnable(GL_TEXTURE_2D_ARRAY);  // another error is only logged
  EXPECT_TRUE(check_gl_memory("the scene"));
}

TEST_F(BadInput, ATextureBeyondTheLimitIsNamedAndShownReduced) {
  scene::Scene scene = wall_and_part();
  scene::Material& material = scene.slots[0].variants[0].mesh.materials[0];
  material.base_colour = {1, 1, 1};
  material.texture = cv::Mat(16, 6000, CV_8UC3, cv::Scalar(0, 255, 0));
  material.texture.colRange(3000, 6000).setTo(cv::Scalar(255, 0, 0));
  material.texture_file = "skins/stripes.png";
  testing::internal::CaptureStderr();
  Renderer drawing = renderer(scene, one_projector());
  const std::string messages = testing::internal::GetCapturedStderr();
  for (const char* word : {"skins/stripes.png", "4096 x 4096", "6000 x 16", "reduced to 4096 x 16"})
    EXPECT_NE(messages.find(word), std::string::npos) << word << " in: " << messages;
  const cv::Mat seen =
      drawing.composite(0, cv::Mat::zeros(240, 320, CV_8UC3), posed_at_origin(), Composite::full);
  const auto at = [&](double x) {
    const auto px = *one_projector().cameras[0].project({x, 0, -0.03});
    return seen.at<cv::Vec3b>(static_cast<int>(px.y()), static_cast<int>(px.x()));
  };
  EXPECT_EQ(at(-0.05), cv::Vec3b(0, 255, 0));
  EXPECT_EQ(at(0.05), cv::Vec3b(255, 0, 0));
}

TEST_F(BadInput, MapsBeyondTheLimitAreNamedAndReduced) {
  scene::Scene scene = wall_and_part();
  scene::Mesh& mesh = scene.slots[0].variants[0].mesh;
  mesh.materials[0].unlit = false;
  scene::SurfaceMaps& maps = mesh.materials[0].maps;
  maps.normals = {cv::Mat(8, 5000, CV_8UC3, cv::Scalar(255, 128, 128)), "skins/bumps.png"};
  maps.metallic_roughness = {cv::Mat(5001, 8, CV_8UC3, cv::Scalar(0, 128, 0)), "skins/rough.png"};
  maps.occlusion = {cv::Mat(8, 5002, CV_8UC3, cv::Scalar(0, 0, 200)), "skins/folds.png"};
  scene::add_tangents(&mesh);
  testing::internal::CaptureStderr();
  Renderer drawing = renderer(scene, one_projector());
  const std::string messages = testing::internal::GetCapturedStderr();
  for (const char* word :
       {"skins/bumps.png", "5000 x 8", "skins/rough.png", "8 x 5001", "skins/folds.png", "5002 x 8"})
    EXPECT_NE(messages.find(word), std::string::npos) << word << " in: " << messages;
  const cv::Mat seen =
      drawing.composite(0, cv::Mat::zeros(240, 320, CV_8UC3), posed_at_origin(), Composite::full);
  EXPECT_GT(brightest(seen), 50);
}

TEST_F(BadInput, AnAlbedoBeyondTheLimitIsNamedAndReduced) {
  scene::Scene scene = wall_and_part();
  scene.prototype->albedo_image = cv::Mat(8, 5000, CV_8UC3, cv::Scalar(200, 200, 200));
  testing::internal::CaptureStderr();
  Renderer drawing = renderer(scene, one_projector());
  const std::string messages = testing::internal::GetCapturedStderr();
  for (const char* word : {"albedo", "4096 x 4096", "5000 x 8"})
    EXPECT_NE(messages.find(word), std::string::npos) << word << " in: " << messages;
}

TEST_F(BadInput, MoreTrianglesThanTheDriverHoldsAreRefused) {
  const std::size_t most = GpuScene::most_triangles();
  EXPECT_GT(most, 10'000U);  // GL 4.5 guarantees 65536 texels
  if (most > 40'000'000) GTEST_SKIP() << "this driver holds " << most;
  scene::Scene scene = wall_and_part();
  scene::Mesh& mesh = scene.prototype->mesh;
  mesh.tangents.resize(mesh.positions.size());  // with tangents, its triangles count twice
  const std::size_t parts = 2, fits = (most - parts) / 2, count = 2 * (fits + 1) + parts;
  mesh.triangles.resize(fits + 1, {0, 2, 1});
  mesh.triangle_materials.resize(fits + 1, 0);
  const auto made = Renderer::create(scene, one_projector());
  ASSERT_FALSE(made);
  EXPECT_NE(made.message().find(std::to_string(most)), std::string::npos) << made.message();
  EXPECT_NE(made.message().find(std::to_string(count)), std::string::npos) << made.message();
  mesh.triangles.pop_back();
  EXPECT_TRUE(GpuScene::check_fits(scene, most));
}

TEST_F(BadInput, AProjectorThatSeesNothingIsBlackAndTakesNoShare) {
  const scene::Scene scene = wall_and_part();
  const Imager viewer = viewer_from({0.1, -0.2, -1}, {0, 0, 0});
  const cv::Mat alone = renderer(scene, one_projector()).projector_image(0, posed_at_origin(), viewer);
  Rig rig = one_projector();
  rig.projectors.push_back(projector_from("away", {0, 0, -1}, {0, 0, -2}));
  rig.projectors.push_back(projector_from("behind", {0, 0, 1}, {0, 0, 0}));
  Renderer drawing = renderer(scene, rig);
  EXPECT_GT(brightest(alone), 150);
  EXPECT_EQ(cv::norm(drawing.projector_image(0, posed_at_origin(), viewer), alone, cv::NORM_INF), 0);
  EXPECT_EQ(brightest(drawing.projector_image(1, posed_at_origin(), viewer)), 0);
  EXPECT_EQ(brightest(drawing.projector_image(2, posed_at_origin(), viewer)), 0);
}

TEST_F(BadInput, NoPlaceOfTheViewersEyeMakesMoreLightThanThePartHas) {
  const scene::Scene scene = wall_and_part();
  Renderer drawing = renderer(scene, one_projector());
  const int own = static_cast<int>(std::ceil(255 * std::pow(0.5, 1 / 2.2)));
  const Vector3d behind(0, 0, 0.5);
  for (const Vector3d& p_viewpoint :
       {behind, Vector3d(0.01, 0, 0), Vector3d(0, 0, -0.03), Vector3d(0.02, 0.01, -0.0301),
        Vector3d(0, 0, -0.01), Vector3d(0.2, 0.1, -1e-4), Vector3d(0, 0, -100)}) {
    const Imager viewer =
        viewer_from(p_viewpoint, p_viewpoint.z() < -0.03 ? Vector3d(0, 0, 0) : Vector3d(0.001, 0, 0.3));
    const cv::Mat image = drawing.projector_image(0, posed_at_origin(), viewer);
    EXPECT_LE(brightest(image), own) << p_viewpoint.transpose();
    if (p_viewpoint == behind) {
      EXPECT_EQ(brightest(image), 0);
    }
    for (const PartCoverage& part : drawing.coverage(posed_at_origin(), viewer)) {
      EXPECT_GE(part.on_surface_share, 0);
      EXPECT_LE(part.on_surface_share, 1);
    }
  }
}

TEST(LostContext, ARendererIsMadeAnewFromSceneAndRig) {
  const scene::Scene scene = wall_and_part();
  const Rig rig = one_projector();
  const Imager viewer = viewer_from({0.1, -0.2, -1}, {0, 0, 0});
  std::optional<device::GlContext> context;
  std::optional<Renderer> drawing;
  std::vector<cv::Mat> images;
  for (int life = 0; life < 3; ++life) {
    drawing.reset();  // the same order as for a lost context
    context.reset();
    if (life > 0) {
      EXPECT_GT(brightest(images.back()), 150);  // the last good image is an independent copy
    }
    auto made = device::GlContext::create();
    ASSERT_TRUE(made) << made.message();
    context.emplace(std::move(made).value());
    auto renderer = Renderer::create(scene, rig);
    ASSERT_TRUE(renderer) << renderer.message();
    drawing.emplace(std::move(renderer).value());
    images.push_back(drawing->projector_image(0, posed_at_origin(), viewer));
    EXPECT_EQ(cv::norm(images.back(), images.front(), cv::NORM_INF), 0);
    EXPECT_FALSE(context->is_lost());
  }
}

}  // namespace
}  // namespace limn::projector
