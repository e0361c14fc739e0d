#pragma once

#include <map>
#include <tuple>

#include "projector/gl.h"

namespace limn::projector {

/// An image that is drawn into.
struct Canvas {
  int width = 0, height = 0;
  GlName texture, framebuffer;

  Canvas() = default;
  Canvas(int width, int height, GLenum format);
};

/// Canvases for what is drawn and used up at once, one a size and format.
class CanvasPool {
 public:
  /// Good until the next call with the same values draws into it.
  const Canvas& canvas(int width, int height, GLenum format);

 private:
  std::map<std::tuple<int, int, GLenum>, Canvas> canvases_;
};

}  // namespace limn::projector
