#pragma once

#include <opencv2/core/types.hpp>
#include <span>

#include "projector/gl.h"
#include "projector/resources.h"

namespace limn::projector {

/// Pixels on the GPU that want work, listed by one program and worked through by the next one
/// (shaders/listed.glsl).
class PixelList final : public Bindable {
 public:
  /// Empties it; room for so many pixels.
  void start(int pixels);
  /// As Resource::work_list or Resource::deferred_list.
  void bind(const Use& use) const override;
  /// Runs the current program over its pixels, 64 a group.
  void dispatch() const;

 private:
  GlName buffer_;
  int room_ = 0;
};

/// Empties an image of linear light (GL_RGBA32F) within rectangles, and their neighbours, by which edges are
/// judged.
void clear_light(const GlName& light, cv::Size size, std::span<const cv::Rect> places);

}  // namespace limn::projector
