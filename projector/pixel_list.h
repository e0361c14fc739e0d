#pragma once

#include <opencv2/core/types.hpp>
#include <span>

#include "projector/gl.h"
#include "projector/shader.h"

namespace limn::projector {

/// Pixels on the GPU that want work, listed by one program and worked through by the next one
/// (shaders/listed.glsl).
class PixelList {
 public:
  /// Empties it; room for so many pixels.
  void start(int pixels);
  /// For a program that lists pixels.
  void bind() const;
  /// For a program that leaves pixels to another one (shaders/rest.glsl) while it works through a list.
  void bind_as_rest() const;
  /// Runs a program over its pixels, 64 a group.
  void work_through(const Program& program) const;

 private:
  GlName buffer_;
  int room_ = 0;
};

/// Empties an image of linear light (GL_RGBA32F) within rectangles, and their neighbours, by which edges are
/// judged.
void clear_light(const GlName& light, cv::Size size, std::span<const cv::Rect> places);

/// Unit of the image whose edges shaders/edges.comp lists, its only texture.
constexpr int k_edges_unit = 3;

/// Runs a program over rectangles of an image, 16 x 4 pixels a group, which are u_first ... u_end to it.
void look_through(const Program& program, std::span<const cv::Rect> places);

}  // namespace limn::projector
