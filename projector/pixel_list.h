#pragma once

#include <opencv2/core/types.hpp>
#include <span>

#include "projector/gl.h"
#include "projector/resources.h"

namespace limn::projector {

/// A list of pixels on the GPU. One pass fills it, the next one processes it (shaders/work_list.glsl).
class PixelList final : public Bindable {
 public:
  /// Empties the list and makes room for `pixels` entries.
  void start(int pixels);
  /// Binds it as Resource::work_list or Resource::deferred_list.
  void bind(const Use& use) const override;
  /// Runs the current program over its pixels, 64 in each work group.
  void dispatch() const;

 private:
  GlName buffer_;
  int room_ = 0;
};

/// Clears an image of linear light (GL_RGBA32F) within rectangles and in the `around` pixels around them.
void clear_light(const GlName& light, cv::Size size, std::span<const cv::Rect> places, int around);

}  // namespace limn::projector
