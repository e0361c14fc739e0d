#pragma once

#include <memory>

#include "device/display.h"

namespace limn::device {

/// A display that takes both eyes' images through an ordinary one: packed into one image (side_by_side,
/// top_bottom), or in turns (frame_sequential).
class StereoDisplay : public Display {
 public:
  /// `layout`: one of the three above.
  StereoDisplay(std::unique_ptr<Display> display, StereoLayout layout);

  const std::string& name() const override { return display_->name(); }
  /// The size of each eye's image. A packed one is scaled down to half of it.
  cv::Size size() const override { return display_->size(); }
  /// Shows the image to both eyes.
  Result<Stamp> show(const cv::Mat& image) override { return show_eyes({image}); }
  bool is_stereo() const override { return true; }
  /// frame_sequential: shows the left image, then the right one. Where the display waits for its refresh,
  /// each stays for one; so the session must make an image in two refreshes. Returns the first one's moment.
  Result<Stamp> show_eyes(const EyeImages& images) override;

 private:
  std::unique_ptr<Display> display_;
  StereoLayout layout_;
};

}  // namespace limn::device
