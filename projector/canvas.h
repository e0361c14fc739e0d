#pragma once

#include <map>
#include <tuple>

#include "projector/gl.h"

namespace limn::projector {

/// A texture with a framebuffer, into which passes draw.
struct Canvas {
  int width = 0, height = 0;
  GlName texture, framebuffer;

  Canvas() = default;
  Canvas(int width, int height, GLenum format);
};

/// Temporary canvases, one for each size and format.
class CanvasPool {
 public:
  /// Its contents are valid until the next call with the same size and format draws into it.
  const Canvas& canvas(int width, int height, GLenum format);

 private:
  std::map<std::tuple<int, int, GLenum>, Canvas> canvases_;
};

}  // namespace limn::projector
