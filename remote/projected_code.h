#pragma once

#include <chrono>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "projector/overlays/overlays.h"
#include "session/session.h"

namespace limn::remote {

/// The pairing code in a projector's light, for a limited time: its image, and its place on the prototype.
/// The session's frame loop draws it as an overlay, so that recordings and the images that guests get do not
/// show it. Belongs to the session's thread.
class ProjectedCode {
 public:
  using Clock = std::chrono::steady_clock;
  /// The code's text, and the text below it.
  struct Text {
    std::string url, pin, role;
  };

  /// Sets how long the code is shown.
  void set_duration(std::chrono::milliseconds duration) { duration_ = duration; }
  /// Has a projector show a code from the next frame on; any other projector stops. `on_shown` is called when
  /// the code is first shown, with the time of its end.
  void show(const std::string& projector, Text text, std::function<void(Clock::time_point until)> on_shown);
  /// The projector that shows the code; empty: none.
  const std::string& projector() const { return projector_; }

  /// The code, on the largest flat and free piece of the prototype, or in the middle of the image if there is
  /// none. Empty during a blackout and when the time is over.
  std::vector<projector::Overlay> overlays(session::Session* session);

 private:
  bool start_if_due(session::Session* session, std::size_t projector);
  void end();

  std::chrono::milliseconds duration_{};
  std::string projector_;
  Text text_;
  std::function<void(Clock::time_point)> on_shown_;
  std::optional<Clock::time_point> requested_at_, searched_at_,
      shown_until_;  // nullopt before the first frame
  cv::Mat sign_;
  std::optional<projector::OverlayPlace> place_;  // its place on the prototype
};

}  // namespace limn::remote
