#pragma once

#include <chrono>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "session/overlays.h"
#include "session/session.h"

namespace limn::remote {

/// A code for guests in a projector's light, for a while: its image, and a place for it on the prototype. The
/// session's frame loop draws it; what guests and recordings get stays what was painted.
class ProjectedCode {
 public:
  using Clock = std::chrono::steady_clock;
  /// What the code says, and what stands below it.
  struct Text {
    std::string url, pin, role;
  };

  /// How long it is shown.
  void set_duration(std::chrono::milliseconds duration) { duration_ = duration; }
  /// From the next frame on a projector shows this code; no other one does then. `on_shown` is told, when it
  /// is seen first, until when.
  void show(const std::string& projector, Text text, std::function<void(Clock::time_point until)> on_shown);
  /// Who shows it; empty: nobody.
  const std::string& projector() const { return projector_; }

  /// The code on the largest flat and free piece of the prototype (in the image's middle, where there is
  /// none). Nothing under a blackout, and when it is over.
  std::vector<apps::Overlay> overlays(apps::Session* session);

 private:
  bool start_if_due(apps::Session* session, std::size_t projector);
  void end();

  std::chrono::milliseconds duration_{};
  std::string projector_;
  Text text_;
  std::function<void(Clock::time_point)> on_shown_;
  std::optional<Clock::time_point> requested_at_, searched_at_, shown_until_;  // none before the first frame
  cv::Mat sign_;
  std::optional<apps::OverlayPlace> place_;  // on the prototype
};

}  // namespace limn::remote
