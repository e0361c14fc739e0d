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

/// Temporary canvases, one for each size and format.
class CanvasPool {
 public:
  /// Its contents are valid until somebody draws into the canvas of another call with the same size and
  /// format.
  const Canvas& canvas(int width, int height, GLenum format);

 private:
  std::map<std::tuple<int, int, GLenum>, Canvas> canvases_;
};

}  // namespace limn::projector
