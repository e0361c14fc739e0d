#include "session/frame_gate.h"

#include <fmt/format.h>

#include <utility>

namespace limn::session {

FrameGate::FrameGate(std::string camera, cv::Size size, std::size_t number, DeviceHealth* health)
    : camera_(std::move(camera)), size_(size), number_(number), health_(health) {}

std::optional<Frame> FrameGate::taken(Result<Frame> sent, Stamp now) {
  if (!sent) {
    health_->fails(number_, sent.message());
    return std::nullopt;
  }
  if (sent->image.size() != size_) {
    health_->fails(
        number_, fmt::format("expected images of {}x{} pixels, found one of {}x{}. Set the camera mode that "
                             "the rig was calibrated with.",
                             size_.width, size_.height, sent->image.cols, sent->image.rows));
    return std::nullopt;
  }
  health_->works(number_);
  const device::SourceClock::Time time = clock_.on_session_clock(sent->captured_at, now);
  if (time.has_stepped)
    health_->note(camera_ + "'s clock has stepped; its images are assumed to have the same delay as before");
  sent->captured_at = time.captured_at;
  return std::move(*sent);
}

}  // namespace limn::session
