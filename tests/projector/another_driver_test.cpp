// Other drivers must draw the same as Mesa's llvmpipe: softpipe, which shares neither rasteriser nor shader
// compiler with it, and zink, which draws with Vulkan.
#include <epoxy/gl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <string>

#include "core/image_io.h"
#include "projector/composite_policy.h"
#include "scene/scene.h"
#include "tests/projector/sheet_room.h"
#include "tests/support/matchers.h"

namespace limn::projector {
namespace {

namespace fs = std::filesystem;

// Gold, steel and lacquer with textures; one part stands off the surface, one lies on it.
Scene finishes() {
  Scene scene = scene::load_scene(fs::path(LIMN_SOURCE_DIR) / "config/scenes/finishes").value();
  scene.prototype = scene::Prototype{grid(12, 9,
                                          [](double u, double v) {
                                            return Vector3d(0.6 * (u - 0.5), 0.45 * (v - 0.5),
                                                            0.12 * std::pow(u - 0.45, 2));
                                          }),
                                     {},
                                     0.75,
                                     {}};
  return scene;
}

// Half the resolution, because softpipe is slow.
Imager half_as_large(Imager imager) {
  std::vector<double> values = imager.lens.values;
  for (std::size_t i = 0; i < 4; ++i) values[i] /= 2;
  imager.lens = Lens::create(imager.lens.model.name(), values).value();
  imager.width /= 2;
  imager.height /= 2;
  return imager;
}

std::map<std::string, cv::Mat> images() {
  const Scene scene = finishes();
  Rig rig;
  rig.cameras = {half_as_large(camera())};
  rig.projectors = {half_as_large(projector_left()), half_as_large(projector_right())};
  const Eigen::Quaterniond towards_us = exp_rotation(Vector3d(M_PI, 0, 0));
  PosedScene posed;
  posed.world_from_prototype = Pose();
  posed.parts = {{"emblem", "gold", Pose(towards_us, Vector3d(-0.08, -0.03, -0.05))},
                 {"plate", "steel", Pose(towards_us, Vector3d(0.06, 0.08, -0.002))}};
  const Imager viewer = half_as_large(viewer_from({0.2, -0.3, -1.2}));
  Renderer drawing = Renderer::create(scene, rig).value();
  std::map<std::string, cv::Mat> out;
  out["light0"] = drawing.projector_image(0, posed, viewer);
  out["light1"] = drawing.projector_image(1, posed, viewer);
  EXPECT_TRUE(drawing.set_light({.compensation = Compensation::geometry, .even_black = true}));
  out["balanced0"] = drawing.projector_image(0, posed, viewer);
  out["balanced1"] = drawing.projector_image(1, posed, viewer);
  const cv::Mat grey(240, 320, CV_8UC3, cv::Scalar(90, 100, 110));
  out["full"] = drawing.composite(0, grey, posed, Composite::full);
  out["rest"] = drawing.composite(0, grey, posed, Composite::rest);
  out["view"] = drawing.view(viewer, posed, cv::Scalar(40, 30, 20));
  EXPECT_TRUE(drawing.set_contact_shadow(&scene));
  out["shadowed"] = drawing.composite(0, grey, posed, Composite::full);
  return out;
}

using Settings = std::map<std::string, std::string>;  // environment variables besides the driver's name

// Draws in a separate process, because a process keeps its driver. Returns false when Mesa has no such driver
// here.
bool draw_with(const std::string& driver, const Settings& settings, const fs::path& folder) {
  const pid_t child = fork();
  if (child == 0) {
    setenv("GALLIUM_DRIVER", driver.c_str(), 1);
    setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
    for (const auto& [name, value] : settings) setenv(name.c_str(), value.c_str(), 1);
    const auto context = device::GlContext::create();
    const auto name = [] { return std::string(reinterpret_cast<const char*>(glGetString(GL_RENDERER))); };
    if (!context || name().find(driver) == std::string::npos) _exit(1);
    for (const auto& [of, image] : images())
      if (!write_png(folder / (of + ".png"), image)) _exit(2);
    _exit(testing::Test::HasFailure() ? 2 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) < 2) << driver;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

// The limit between machines is 2 levels in 0.1 % of the pixels. Only pixels of parts count, because most of
// an image is black.
void expect_same_images(const std::string& driver, const Settings& settings, const fs::path& usual) {
  const fs::path folder = test::test_folder();
  fs::create_directories(folder / driver);
  if (usual.empty()) GTEST_SKIP() << "Mesa's driver llvmpipe is not installed";
  if (!draw_with(driver, settings, folder / driver))
    GTEST_SKIP() << "Mesa's driver " << driver << " is not installed";
  int compared = 0;
  for (const auto& file : fs::directory_iterator(usual)) {
    const cv::Mat expected = read_image(file.path()).value();
    const cv::Mat actual = read_image(folder / driver / file.path().filename()).value();
    ASSERT_EQ(actual.size(), expected.size());
    ASSERT_EQ(actual.type(), expected.type());
    cv::Mat apart;
    cv::absdiff(actual, expected, apart);
    int lit = 0, far = 0;
    for (int row = 0; row < apart.rows; ++row)
      for (int column = 0; column < apart.cols; ++column) {
        const auto& levels = apart.at<cv::Vec3b>(row, column);
        lit += expected.at<cv::Vec3b>(row, column) != expected.at<cv::Vec3b>(0, 0);
        far += std::max({levels[0], levels[1], levels[2]}) > 2;
      }
    EXPECT_GT(lit, 1000) << file.path();
    EXPECT_LE(far, 0.001 * lit) << file.path();
    ++compared;
  }
  EXPECT_EQ(compared, 8);
}

class AnotherDriver : public ::testing::Test {
 protected:
  // The usual driver's images serve all tests.
  static void SetUpTestSuite() {
    const fs::path folder = fs::path(testing::TempDir()) / "AnotherDriver-llvmpipe";
    fs::remove_all(folder);
    fs::create_directories(folder);
    if (draw_with("llvmpipe", {}, folder)) usual_ = folder;
  }
  static inline fs::path usual_;  // empty: there is no such driver
};

TEST_F(AnotherDriver, OfScalarShadersDrawsTheSame) {
  // softpipe reports OpenGL 3.3, but supports everything that is used here.
  expect_same_images("softpipe", {{"MESA_GL_VERSION_OVERRIDE", "4.5"}, {"MESA_GLSL_VERSION_OVERRIDE", "450"}},
                     usual_);
}

TEST_F(AnotherDriver, OfVulkanDrawsTheSame) {
  // For software rendering zink compiles variants of programs for the values of their uniforms (Mesa 22.3 to
  // 25.0), and sometimes uses the variant of other values. This setting turns that off.
  expect_same_images("zink", {{"MESA_LOADER_DRIVER_OVERRIDE", "zink"}, {"ZINK_INLINE_UNIFORMS", "0"}},
                     usual_);
}

}  // namespace
}  // namespace limn::projector
