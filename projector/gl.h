#pragma once

#include <epoxy/gl.h>

#include <opencv2/core/mat.hpp>
#include <utility>

namespace limn::projector {

/// A GL object that is owned here. Needs the context that made it to be current when it dies.
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
/// A buffer with this content.
GlName make_buffer(const void* data, std::size_t bytes);
/// All of a buffer as the texels of a GL_TEXTURE_BUFFER, which shows what the buffer holds by then.
GlName make_texels(const GlName& buffer, GLenum format);

/// Fills a GL_TEXTURE_2D of make_texture from an image of 1-4 channels, 8-bit or float; first row first.
void upload(const GlName& texture, const cv::Mat& image);
/// The same for a rectangle of the image alone, to the same place of the texture.
void upload(const GlName& texture, const cv::Mat& image, const cv::Rect& place);
/// A rectangle of the colour attachment of a framebuffer to the same place of the image (CV_8UC3, BGR).
void read_back(const GlName& framebuffer, const cv::Rect& place, cv::Mat* image);
/// The colour attachment of a framebuffer, first row first, as an image of `type` (CV_8UC3 comes as BGR).
cv::Mat read_back(const GlName& framebuffer, int width, int height, int type, GLenum format);

/// Texels a side that an image of a scene may have: what the context holds, 4096 at most.
int largest_texture();
/// The image, reduced to largest_texture() where it is larger; that is told, under its name.
cv::Mat fitting_texture(const cv::Mat& image, const std::string& name);

}  // namespace limn::projector
