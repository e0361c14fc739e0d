#include "projector/gl.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

#include "core/log.h"
#include "core/result.h"

namespace limn::projector {
namespace {

constexpr int k_most_errors = 64;  // that OpenGL records at once; a lost context gives them without end

const char* gl_error_name(GLenum code) {
  switch (code) {
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
      return "GL_OUT_OF_MEMORY";
    case GL_CONTEXT_LOST:
      return "GL_CONTEXT_LOST";
    default:
      return "an unknown error";
  }
}

// The card's free memory, as far as the driver tells it.
std::string free_memory() {
  std::array<GLint, 4> kilobytes = {};
  if (epoxy_has_gl_extension("GL_NVX_gpu_memory_info"))
    glGetIntegerv(GL_GPU_MEMORY_INFO_CURRENT_AVAILABLE_VIDMEM_NVX, kilobytes.data());
  else if (epoxy_has_gl_extension("GL_ATI_meminfo"))
    glGetIntegerv(GL_TEXTURE_FREE_MEMORY_ATI, kilobytes.data());
  else
    return "";
  return fmt::format(", {} MB free", kilobytes[0] / 1024);
}

}  // namespace

void forget_gl_errors() {
  for (int i = 0; i < k_most_errors && glGetError() != GL_NO_ERROR; ++i) {
  }
}

Status check_gl_memory(const std::string& what) {
  bool is_full = false;
  for (int i = 0; i < k_most_errors; ++i) {
    const GLenum code = glGetError();
    if (code == GL_NO_ERROR) break;
    is_full |= code == GL_OUT_OF_MEMORY;
    if (code != GL_OUT_OF_MEMORY) log_warning("OpenGL: {} while {} was made.", gl_error_name(code), what);
  }
  if (!is_full) return {};
  return error(
      "{}: expected room in the graphics card's memory, found none ({}{}). Make the scene's textures and "
      "meshes "
      "smaller, leave out variants, end other programs that draw, or use a card with more memory.",
      what, gl_error_name(GL_OUT_OF_MEMORY), free_memory());
}

GlName make_texture(GLenum target, GLenum format, int width, int height, int layers, int levels) {
  GLuint name = 0;
  glCreateTextures(target, 1, &name);
  GlName texture(name, [](GLuint n) { glDeleteTextures(1, &n); });
  if (target == GL_TEXTURE_2D_ARRAY || target == GL_TEXTURE_3D) {
    glTextureStorage3D(name, levels, format, width, height, layers);
  } else {
    glTextureStorage2D(name, levels, format, width, height);
  }
  glTextureParameteri(name, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTextureParameteri(name, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTextureParameteri(name, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTextureParameteri(name, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  if (target == GL_TEXTURE_3D) glTextureParameteri(name, GL_TEXTURE_WRAP_R, GL_CLAMP_TO_EDGE);
  return texture;
}

GlName make_framebuffer() {
  GLuint name = 0;
  glCreateFramebuffers(1, &name);
  return {name, [](GLuint n) { glDeleteFramebuffers(1, &n); }};
}

GlName make_vertex_array() {
  GLuint name = 0;
  glCreateVertexArrays(1, &name);
  return {name, [](GLuint n) { glDeleteVertexArrays(1, &n); }};
}

GlName make_depth_buffer(int width, int height) {
  GLuint name = 0;
  glCreateRenderbuffers(1, &name);
  glNamedRenderbufferStorage(name, GL_DEPTH_COMPONENT32F, width, height);
  return {name, [](GLuint n) { glDeleteRenderbuffers(1, &n); }};
}

GlName make_buffer(const void* data, std::size_t bytes) {
  GLuint name = 0;
  glCreateBuffers(1, &name);
  constexpr std::size_t k_least = 16;  // an empty buffer cannot be bound
  glNamedBufferData(name, static_cast<GLsizeiptr>(std::max(bytes, k_least)), nullptr, GL_DYNAMIC_DRAW);
  if (data && bytes > 0) glNamedBufferSubData(name, 0, static_cast<GLsizeiptr>(bytes), data);
  return {name, [](GLuint n) { glDeleteBuffers(1, &n); }};
}

GlName make_texels(const GlName& buffer, GLenum format) {
  GLuint name = 0;
  glCreateTextures(GL_TEXTURE_BUFFER, 1, &name);
  glTextureBuffer(name, format, *buffer);
  return {name, [](GLuint n) { glDeleteTextures(1, &n); }};
}

void upload(const GlName& texture, const cv::Mat& image) {
  LIMN_CHECK(image.depth() == CV_8U || image.depth() == CV_32F);
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  const bool bytes = whole.depth() == CV_8U;
  const GLenum formats[] = {GL_RED, GL_RG, static_cast<GLenum>(bytes ? GL_BGR : GL_RGB),
                            static_cast<GLenum>(bytes ? GL_BGRA : GL_RGBA)};
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTextureSubImage2D(*texture, 0, 0, 0, whole.cols, whole.rows, formats[whole.channels() - 1],
                      bytes ? GL_UNSIGNED_BYTE : GL_FLOAT, whole.data);
}

void upload(const GlName& texture, const cv::Mat& image, const cv::Rect& place) {
  LIMN_CHECK(image.type() == CV_8UC3 && image.isContinuous());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glPixelStorei(GL_UNPACK_ROW_LENGTH, image.cols);
  glTextureSubImage2D(*texture, 0, place.x, place.y, place.width, place.height, GL_BGR, GL_UNSIGNED_BYTE,
                      image.ptr(place.y, place.x));
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

void read_back(const GlName& framebuffer, const cv::Rect& place, cv::Mat* image) {
  LIMN_CHECK(image->type() == CV_8UC3 && image->isContinuous());
  glBindFramebuffer(GL_READ_FRAMEBUFFER, *framebuffer);
  glReadBuffer(GL_COLOR_ATTACHMENT0);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glPixelStorei(GL_PACK_ROW_LENGTH, image->cols);
  glReadPixels(place.x, place.y, place.width, place.height, GL_BGR, GL_UNSIGNED_BYTE,
               image->ptr(place.y, place.x));
  glPixelStorei(GL_PACK_ROW_LENGTH, 0);
}

cv::Mat read_back(const GlName& framebuffer, int width, int height, int type, GLenum format) {
  cv::Mat image(height, width, type);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, *framebuffer);
  glReadBuffer(GL_COLOR_ATTACHMENT0);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, format, CV_MAT_DEPTH(type) == CV_8U ? GL_UNSIGNED_BYTE : GL_FLOAT,
               image.data);
  return image;
}

int largest_texture() {
  constexpr int k_most = 4096;
  GLint most = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
  return std::min(most, k_most);
}

cv::Mat fitting_texture(const cv::Mat& image, const std::string& name) {
  const int most = largest_texture();
  if (image.cols <= most && image.rows <= most) return image;
  const cv::Size size(std::min(most, image.cols), std::min(most, image.rows));
  log_warning(
      "{}: expected a texture of at most {} x {} texels, found {} x {}; it was reduced to {} x {}. "
      "Save the image in a smaller size.",
      name, most, most, image.cols, image.rows, size.width, size.height);
  cv::Mat reduced;
  cv::resize(image, reduced, size, 0, 0, cv::INTER_AREA);
  return reduced;
}

}  // namespace limn::projector
