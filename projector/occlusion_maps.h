#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "projector/resources.h"

namespace limn::projector {

/// The share of each projector's light that arrives (Renderer::set_occlusion), one layer for each projector.
class OcclusionMaps final : public Bindable {
 public:
  /// Starts with all light arriving.
  explicit OcclusionMaps(std::size_t projectors);
  /// As Renderer::set_occlusion. Returns false when nothing changes.
  bool set(std::size_t projector, const cv::Mat& map);
  /// Number of changes of any map so far.
  unsigned changes() const { return changes_; }
  /// Binds Resource::occlusion.
  void bind(const Use& use) const override;

 private:
  GlName layers_;
  std::vector<cv::Mat> maps_;  // the same values as in the layers
  unsigned changes_ = 0;
};

}  // namespace limn::projector
