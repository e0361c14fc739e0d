#include "projector/canvas.h"

namespace limn::projector {

Canvas::Canvas(int width_in, int height_in, GLenum format) : width(width_in), height(height_in) {
  texture = make_texture(GL_TEXTURE_2D, format, width, height);
  framebuffer = make_framebuffer();
  glNamedFramebufferTexture(*framebuffer, GL_COLOR_ATTACHMENT0, *texture, 0);
}

const Canvas& CanvasPool::canvas(int width, int height, GLenum format) {
  Canvas& canvas = canvases_[{width, height, format}];
  if (!canvas.texture) canvas = Canvas(width, height, format);
  return canvas;
}

}  // namespace limn::projector
