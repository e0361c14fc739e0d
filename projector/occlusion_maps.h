#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "projector/resources.h"

namespace limn::projector {

/// How much of each projector's light arrives (Renderer::set_occlusion), a layer a projector.
class OcclusionMaps final : public Bindable {
 public:
  /// All of it.
  explicit OcclusionMaps(std::size_t projectors);
  /// As Renderer::set_occlusion. False when it was so already.
  bool set(std::size_t projector, const cv::Mat& map);
  /// How often any of them has changed.
  unsigned changes() const { return changes_; }
  /// Resource::occlusion.
  void bind(const Use& use) const override;

 private:
  GlName layers_;
  std::vector<cv::Mat> maps_;  // as they are in the layers
  unsigned changes_ = 0;
};

}  // namespace limn::projector
