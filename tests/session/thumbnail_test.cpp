#include "session/drawing/thumbnail.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "core/image_io.h"
#include "device/gl_context.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

// Each variant fills its image without being cut off, and differs from the others.
TEST(Thumbnail, ShowsEachVariantWhole) {
  const auto scene = scene::load_scene(std::filesystem::path(LIMN_SOURCE_DIR) / "config/scenes/door");
  ASSERT_TRUE(scene) << scene.message();
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto renderer = projector::Renderer::create(*scene, Rig{});
  ASSERT_TRUE(renderer) << renderer.message();
  const std::filesystem::path folder = test::test_folder();
  for (const scene::Slot& slot : scene->slots) {
    std::vector<cv::Mat> images;
    for (const scene::Variant& variant : slot.variants) {
      const cv::Mat image = draw_thumbnail(&*renderer, *scene, slot.name, variant.name, 256);
      ASSERT_EQ(image.size(), cv::Size(256, 256));
      ASSERT_TRUE(write_png(folder / (slot.name + "-" + variant.name + ".png"), image));
      cv::Mat differs;
      cv::inRange(image, image.at<cv::Vec3b>(0, 0), image.at<cv::Vec3b>(0, 0), differs);
      const cv::Rect part = cv::boundingRect(255 - differs);
      EXPECT_GT(std::max(part.width, part.height), 150) << slot.name << " " << variant.name;
      EXPECT_TRUE(part.x > 0 && part.y > 0 && part.br().x < 256 && part.br().y < 256);
      for (const cv::Mat& other : images) EXPECT_GT(cv::norm(image, other, cv::NORM_L1), 1e4);
      images.push_back(image);
    }
  }
  EXPECT_TRUE(draw_thumbnail(&*renderer, *scene, "mirror", "none", 64).empty());
  EXPECT_TRUE(draw_thumbnail(&*renderer, *scene, "none", "none", 64).empty());
}

}  // namespace
}  // namespace limn::session
