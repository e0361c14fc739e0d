#pragma once

#include <epoxy/gl.h>

#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>

#include "core/result.h"

namespace limn::projector {

/// Owns one GL object. The context that made it must be current when it is destroyed.
class GlName {
 public:
  GlName() = default;
  GlName(GLuint name, void (*free)(GLuint)) : name_(name), free_(free) {}
  GlName(GlName&& other) noexcept
      : name_(std::exchange(other.name_, 0)), free_(std::exchange(other.free_, nullptr)) {}
  GlName& operator=(GlName&& other) noexcept {
    std::swap(name_, other.name_);
    std::swap(free_, other.free_);
    return *this;
  }
  ~GlName() {
    if (free_) free_(name_);
  }
  GLuint operator*() const { return name_; }
  explicit operator bool() const { return name_ != 0; }

 private:
  GLuint name_ = 0;
  void (*free_)(GLuint) = nullptr;
};

/// An immutable-size 2D, 2D array or 3D texture (`layers` deep), nearest filtering, clamped.
GlName make_texture(GLenum target, GLenum format, int width, int height, int layers = 1, int levels = 1);
GlName make_framebuffer();
GlName make_vertex_array();
GlName make_depth_buffer(int width, int height);
/// Makes a buffer with these contents.
GlName make_buffer(const void* data, std::size_t bytes);
/// A GL_TEXTURE_BUFFER over a whole buffer. It always reads the buffer's current contents.
GlName make_texels(const GlName& buffer, GLenum format);

/// Fills a GL_TEXTURE_2D made by make_texture from an image of 1 to 4 channels, 8-bit or float; the first row
/// first.
void upload(const GlName& texture, const cv::Mat& image);
/// Uploads only a rectangle of the image, to the same place in the texture.
void upload(const GlName& texture, const cv::Mat& image, const cv::Rect& place);
/// Reads a rectangle of a framebuffer's colour attachment into the same place of the image (CV_8UC3, BGR).
void read_back(const GlName& framebuffer, const cv::Rect& place, cv::Mat* image);
/// Reads the whole colour attachment of a framebuffer, the first row first, as an image of `type` (CV_8UC3 is
/// BGR).
cv::Mat read_back(const GlName& framebuffer, int width, int height, int type, GLenum format);

/// Forgets the errors that OpenGL has recorded.
void forget_gl_errors();
/// Error: OpenGL has recorded since then that the graphics card's memory is full; `what` was to be made.
/// Other errors are logged by their names.
Status check_gl_memory(const std::string& what);

/// Largest side of a scene's texture, in texels: the context's limit, and at most 4096.
int largest_texture();
/// The image, reduced to largest_texture() if it is larger; a warning then names it.
cv::Mat fitting_texture(const cv::Mat& image, const std::string& name);

}  // namespace limn::projector
