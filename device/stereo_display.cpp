#include "device/stereo_display.h"

#include <utility>

#include "device/offscreen_display.h"

namespace limn::device {

StereoDisplay::StereoDisplay(std::unique_ptr<Display> display, StereoLayout layout)
    : display_(std::move(display)), layout_(layout) {
  LIMN_CHECK(layout == StereoLayout::side_by_side || layout == StereoLayout::top_bottom ||
             layout == StereoLayout::frame_sequential);
}

Result<Stamp> StereoDisplay::show_eyes(const EyeImages& images) {
  LIMN_TRY_STATUS(check_image(images.left, name(), size()));
  if (images.is_stereo()) LIMN_TRY_STATUS(check_image(images.right, name(), size()));
  if (layout_ != StereoLayout::frame_sequential) return display_->show(packed(images, layout_, size()));
  LIMN_TRY(const Stamp shown_at, display_->show(images.left));
  LIMN_TRY([[maybe_unused]] const Stamp right_at,
           display_->show(images.is_stereo() ? images.right : images.left));
  return shown_at;
}

}  // namespace limn::device
