#include "device/window.h"

#include <epoxy/gl.h>

#include <cstdlib>
#include <opencv2/core.hpp>

#include "device/gl_context.h"
#include "tests/support/display.h"
#include "tests/support/matchers.h"

namespace limn::device {
namespace {

TEST(Window, ShowsAnImageAndGivesTheContextBack) {
  if (!test::has_desktop()) GTEST_SKIP() << "no display: Window.ShowsAPictureAndGivesTheContextBack";
  const auto context = GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto window = Window::open("Limn", 320, 240);
  ASSERT_TRUE(window) << window.message();
  cv::Mat image(120, 160, CV_8UC3, cv::Scalar(200, 50, 20));
  image(cv::Rect(0, 0, 80, 60)).setTo(cv::Scalar(0, 0, 255));  // top left: red
  window->show(image);
  window->show(image);
  EXPECT_TRUE(window->is_open());
  EXPECT_EQ(window->poll_pressed_key(), 0);
  // The context without a window is current again.
  EXPECT_NE(context->description().find(reinterpret_cast<const char*>(glGetString(GL_RENDERER))),
            std::string::npos);
  GLuint texture = 0;
  glCreateTextures(GL_TEXTURE_2D, 1, &texture);
  EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
  glDeleteTextures(1, &texture);
  if (const char* seconds = std::getenv("LIMN_TEST_WINDOW_STAYS")) {  // for a person to look at the window
    for (int i = 0; i < 20 * std::atoi(seconds) && window->is_open(); ++i) usleep(50000);
  }
}

TEST(Window, WithoutADisplayTheErrorSaysSo) {
  if (test::has_desktop()) GTEST_SKIP() << "a display is there: Window.WithoutADisplayTheErrorSaysSo";
  const auto window = Window::open("Limn", 320, 240);
  ASSERT_FALSE(window);
  EXPECT_NE(window.message().find("display"), std::string::npos) << window.message();
}

}  // namespace
}  // namespace limn::device
