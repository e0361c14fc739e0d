#pragma once

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "core/image_io.h"
#include "device/gl_context.h"
#include "device/gui/gui.h"

namespace limn::test {

/// A Gui without a window: in memory, with input as a test invents it. LIMN_TEST_KEEP: a folder where
/// keep() leaves images to look at.
class GuiCanvas {
 public:
  explicit GuiCanvas(cv::Size size) : size_(size), context_(device::GlContext::create().value()) {
    glCreateTextures(GL_TEXTURE_2D, 1, &texture_);
    glTextureStorage2D(texture_, 1, GL_RGBA8, size.width, size.height);
    glCreateFramebuffers(1, &framebuffer_);
    glNamedFramebufferTexture(framebuffer_, GL_COLOR_ATTACHMENT0, texture_, 0);
    gui_ = std::make_unique<gui::Gui>(1.F);
  }
  ~GuiCanvas() {
    gui_.reset();
    glDeleteFramebuffers(1, &framebuffer_);
    glDeleteTextures(1, &texture_);
  }

  void draw(const std::function<void(gui::Gui&)>& widgets, const device::WindowInput& input = {}) {
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    gui_->frame(size_, 1 / 30.0, input, [&] { widgets(*gui_); });
  }

  /// A click of the left button: there, pressed, let go; `widgets` is called for each.
  void click(cv::Point2f at, const std::function<void(gui::Gui&)>& widgets) {
    for (const bool held : {false, true, false})
      draw(widgets, {.pointer = at, .buttons = {held, false, false}});
  }

  cv::Mat image() const {
    cv::Mat upside_down(size_, CV_8UC3), image;
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, size_.width, size_.height, GL_BGR, GL_UNSIGNED_BYTE, upside_down.data);
    cv::flip(upside_down, image, 0);
    return image;
  }

  void keep(const std::string& name) const {
    const char* folder = std::getenv("LIMN_TEST_KEEP");
    if (!folder) return;
    EXPECT_TRUE(write_png(std::filesystem::path(folder) / (name + ".png"), image()));
  }

 private:
  cv::Size size_;
  device::GlContext context_;
  GLuint texture_ = 0, framebuffer_ = 0;
  std::unique_ptr<gui::Gui> gui_;
};

}  // namespace limn::test
