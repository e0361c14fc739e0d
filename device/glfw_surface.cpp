#include "device/glfw_surface.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "device/gl_context.h"

namespace limn::device {
namespace {

// Stores the current EGL context and makes it current again in its destructor.
class ContextKept {
 public:
  ContextKept()
      : api_(eglQueryAPI()),
        display_(eglGetCurrentDisplay()),
        context_(eglGetCurrentContext()),
        draw_(eglGetCurrentSurface(EGL_DRAW)),
        read_(eglGetCurrentSurface(EGL_READ)) {}
  ContextKept(const ContextKept&) = delete;
  ContextKept& operator=(const ContextKept&) = delete;
  ~ContextKept() {
    glfwMakeContextCurrent(nullptr);
    if (display_ == EGL_NO_DISPLAY) return;
    eglBindAPI(api_);
    eglMakeCurrent(display_, draw_, read_, context_);
  }

 private:
  EGLenum api_;
  EGLDisplay display_;
  EGLContext context_;
  EGLSurface draw_, read_;
};

// Without a current EGL context another interface (GLX) can have one.
void release_context() {
  if (const EGLDisplay display = eglGetCurrentDisplay(); display != EGL_NO_DISPLAY)
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

// Makes a window's context current, and in its destructor the former one.
class Current {
 public:
  explicit Current(GLFWwindow* window, bool is_native) {
    if (is_native) release_context();
    glfwMakeContextCurrent(window);
  }

 private:
  ContextKept kept_;
};

}  // namespace

std::string glfw_problem() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text ? text : "no reason given";
}

Result<GlfwSurface> GlfwSurface::open(const Options& options) {
  LIMN_TRY_STATUS(check_egl());
  const ContextKept kept;  // GLFW makes the new window's context current for a moment, then none
  // Windows use EGL, as contexts without a window do; but only GLX has framebuffers for two eyes.
  if (options.quad_buffer) release_context();
  glfwWindowHint(GLFW_CONTEXT_CREATION_API,
                 options.quad_buffer ? GLFW_NATIVE_CONTEXT_API : GLFW_EGL_CONTEXT_API);
  glfwWindowHint(GLFW_STEREO, options.quad_buffer ? GLFW_TRUE : GLFW_FALSE);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_AUTO_ICONIFY,
                 GLFW_FALSE);  // full screens stay visible when they lose the keyboard focus
  glfwWindowHint(GLFW_REFRESH_RATE, options.monitor ? options.refresh_hz : GLFW_DONT_CARE);
  GlfwSurface surface;
  surface.window_ =
      glfwCreateWindow(options.width, options.height, options.title.c_str(), options.monitor, nullptr);
  surface.quad_buffer_ = options.quad_buffer;
  if (!surface.window_ && options.quad_buffer)
    return error(
        "{}: expected OpenGL with a framebuffer for each eye (quad_buffer), the display gives none ({}). "
        "Switch "
        "stereo on in the graphics driver's settings, or use side_by_side, top_bottom or frame_sequential.",
        options.title, glfw_problem());
  if (!surface.window_)
    return error(
        "window: expected a window with OpenGL 4.5, the display gives none ({}). Run limn doctor, which says "
        "what is missing.",
        glfw_problem());
  const Current current(surface.window_, options.quad_buffer);
  glfwSwapInterval(options.vsync ? 1 : 0);
  return surface;
}

GlfwSurface::GlfwSurface(GlfwSurface&& other) noexcept
    : window_(std::exchange(other.window_, nullptr)),
      texture_(std::exchange(other.texture_, 0)),
      framebuffer_(std::exchange(other.framebuffer_, 0)),
      size_(other.size_),
      quad_buffer_(other.quad_buffer_) {}

GlfwSurface& GlfwSurface::operator=(GlfwSurface&& other) noexcept {
  std::swap(window_, other.window_);
  std::swap(texture_, other.texture_);
  std::swap(framebuffer_, other.framebuffer_);
  std::swap(size_, other.size_);
  std::swap(quad_buffer_, other.quad_buffer_);
  return *this;
}

GlfwSurface::~GlfwSurface() {
  if (!window_) return;
  {
    const Current current(window_, quad_buffer_);
    glDeleteFramebuffers(1, &framebuffer_);
    glDeleteTextures(1, &texture_);
  }
  glfwDestroyWindow(window_);
}

void GlfwSurface::upload(const cv::Mat& image) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  if (texture_ == 0 || whole.size() != size_) {
    glDeleteTextures(1, &texture_);
    glCreateTextures(GL_TEXTURE_2D, 1, &texture_);
    size_ = whole.size();
    glTextureStorage2D(texture_, 1, GL_RGBA8, size_.width, size_.height);
    if (framebuffer_ == 0) glCreateFramebuffers(1, &framebuffer_);
    glNamedFramebufferTexture(framebuffer_, GL_COLOR_ATTACHMENT0, texture_, 0);
  }
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  cv::Mat bgr = whole;
  if (whole.channels() == 1) cv::merge(std::vector<cv::Mat>{whole, whole, whole}, bgr);
  glTextureSubImage2D(texture_, 0, 0, 0, size_.width, size_.height, GL_BGR, GL_UNSIGNED_BYTE, bgr.data);
}

void GlfwSurface::draw() const {
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  draw_into_back_buffer();
  glfwSwapBuffers(window_);
}

// Draws the image as large as fits, centred. The image's first row is at v = 0, so the window's y is
// inverted.
void GlfwSurface::draw_into_back_buffer() const {
  const cv::Size window = pixels();
  glClearColor(0, 0, 0, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (framebuffer_ != 0 && size_.width > 0) {
    const double scale = std::min(1.0 * window.width / size_.width, 1.0 * window.height / size_.height);
    const int shown_width = static_cast<int>(std::lround(scale * size_.width));
    const int shown_height = static_cast<int>(std::lround(scale * size_.height));
    const int left = (window.width - shown_width) / 2, bottom = (window.height - shown_height) / 2;
    glBlitNamedFramebuffer(framebuffer_, 0, 0, 0, size_.width, size_.height, left, bottom + shown_height,
                           left + shown_width, bottom, GL_COLOR_BUFFER_BIT, GL_LINEAR);
  }
}

void GlfwSurface::show(const cv::Mat& image, bool wait_for_swap) {
  LIMN_CHECK(image.depth() == CV_8U && (image.channels() == 1 || image.channels() == 3));
  const Current current(window_, quad_buffer_);
  upload(image);
  draw();
  if (wait_for_swap) glFinish();
}

void GlfwSurface::show_eyes(const EyeImages& images, bool wait_for_swap) {
  LIMN_CHECK(quad_buffer_);
  const Current current(window_, quad_buffer_);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  const std::pair<const cv::Mat&, GLenum> eyes[] = {
      {images.left, GL_BACK_LEFT}, {images.is_stereo() ? images.right : images.left, GL_BACK_RIGHT}};
  for (const auto& [image, buffer] : eyes) {
    upload(image);
    glDrawBuffer(buffer);
    draw_into_back_buffer();
  }
  glDrawBuffer(GL_BACK);
  glfwSwapBuffers(window_);
  if (wait_for_swap) glFinish();
}

void GlfwSurface::redraw() const {
  if (quad_buffer_) return;  // only one eye's image is still there
  const Current current(window_, quad_buffer_);
  draw();
}

void GlfwSurface::draw_with(const std::function<void(cv::Size)>& paint) const {
  const Current current(window_, quad_buffer_);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  paint(pixels());
  glfwSwapBuffers(window_);
}

void GlfwSurface::in_context(const std::function<void()>& work) const {
  const Current current(window_, quad_buffer_);
  work();
}

cv::Size GlfwSurface::pixels() const {
  cv::Size size;
  glfwGetFramebufferSize(window_, &size.width, &size.height);
  return size;
}

}  // namespace limn::device
