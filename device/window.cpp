#include "device/window.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

namespace limn::device {
namespace {

// Remembers the EGL context that is current and makes it current again at the end.
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

// Makes a window's context current, and what was current before at the end.
class Current {
 public:
  explicit Current(GLFWwindow* window) { glfwMakeContextCurrent(window); }

 private:
  ContextKept kept_;
};

std::string glfw_problem() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text ? text : "no reason given";
}

}  // namespace

struct Window::Impl {
  GLFWwindow* window = nullptr;
  GLuint texture = 0;
  GLuint framebuffer = 0;
  int width = 0, height = 0;  // of the picture
  int key = 0;

  ~Impl() {
    if (window) {
      {
        const Current current(window);
        glDeleteFramebuffers(1, &framebuffer);
        glDeleteTextures(1, &texture);
      }
      glfwDestroyWindow(window);
    }
    glfwTerminate();
  }

  void upload(const cv::Mat& picture);
  void draw() const;
};

void Window::Impl::upload(const cv::Mat& picture) {
  const cv::Mat whole = picture.isContinuous() ? picture : picture.clone();
  const bool grey = whole.channels() == 1;
  if (texture == 0 || whole.cols != width || whole.rows != height) {
    glDeleteTextures(1, &texture);
    glCreateTextures(GL_TEXTURE_2D, 1, &texture);
    width = whole.cols;
    height = whole.rows;
    glTextureStorage2D(texture, 1, GL_RGBA8, width, height);
    if (framebuffer == 0) glCreateFramebuffers(1, &framebuffer);
    glNamedFramebufferTexture(framebuffer, GL_COLOR_ATTACHMENT0, texture, 0);
  }
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  cv::Mat bgr = whole;
  if (grey) cv::merge(std::vector<cv::Mat>{whole, whole, whole}, bgr);
  glTextureSubImage2D(texture, 0, 0, 0, width, height, GL_BGR, GL_UNSIGNED_BYTE, bgr.data);
}

// The picture as large as fits, centred. Its first row is the texture's first, so the window's y is turned.
void Window::Impl::draw() const {
  int window_width = 0, window_height = 0;
  glfwGetFramebufferSize(window, &window_width, &window_height);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glClearColor(0, 0, 0, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (framebuffer != 0 && width > 0) {
    const double scale = std::min(1.0 * window_width / width, 1.0 * window_height / height);
    const int shown_width = static_cast<int>(std::lround(scale * width));
    const int shown_height = static_cast<int>(std::lround(scale * height));
    const int left = (window_width - shown_width) / 2, bottom = (window_height - shown_height) / 2;
    glBlitNamedFramebuffer(framebuffer, 0, 0, 0, width, height, left, bottom + shown_height,
                           left + shown_width, bottom, GL_COLOR_BUFFER_BIT, GL_LINEAR);
  }
  glfwSwapBuffers(window);
}

Window::Window(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Window::Window(Window&&) noexcept = default;
Window& Window::operator=(Window&&) noexcept = default;
Window::~Window() = default;

Result<Window> Window::open(const std::string& title, int width, int height) {
  if (!glfwInit()) {
    return error(
        "window: expected a display to open it on, found none ({}). Log in to a desktop or set DISPLAY.",
        glfw_problem());
  }
  const ContextKept kept;  // GLFW makes the new window's context current for a moment, then none
  auto impl = std::make_unique<Impl>();
  // One API for windows and headless pictures.
  glfwWindowHint(GLFW_CONTEXT_CREATION_API, GLFW_EGL_CONTEXT_API);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  impl->window = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (!impl->window) {
    return error("window: expected one with OpenGL 4.5, the display gives none ({}).", glfw_problem());
  }
  glfwSetWindowUserPointer(impl->window, impl.get());
  glfwSetKeyCallback(impl->window, [](GLFWwindow* window, int key, int, int action, int) {
    if (action != GLFW_PRESS) return;
    static_cast<Impl*>(glfwGetWindowUserPointer(window))->key = key;
    if (key == GLFW_KEY_ESCAPE) glfwSetWindowShouldClose(window, GLFW_TRUE);
  });
  return Window(std::move(impl));
}

void Window::show(const cv::Mat& picture) {
  LIMN_CHECK(picture.depth() == CV_8U && (picture.channels() == 1 || picture.channels() == 3));
  {
    const Current current(impl_->window);
    impl_->upload(picture);
    impl_->draw();
  }
  glfwPollEvents();
}

bool Window::is_open() {
  glfwPollEvents();
  if (glfwWindowShouldClose(impl_->window)) return false;
  const Current current(impl_->window);
  impl_->draw();
  return true;
}

int Window::pressed_key() { return std::exchange(impl_->key, 0); }

}  // namespace limn::device
