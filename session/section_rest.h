#pragma once

#include <deque>
#include <span>

#include "core/track.h"

namespace limn::session {

/// Tells a hand that covers the section's marker from the hand that takes the marker away: what is covered
/// had rested before.
class SectionRest {
 public:
  /// Notes the marker's track at the newest image, if it was measured there.
  void note(std::span<const Track> tracks);
  /// Whether it rested while it was seen last: over k_rest_s it moved by at most 10 mm and 8 degrees.
  bool has_rested() const;

 private:
  std::deque<Track> seen_;  // over the last k_rest_s in which it was seen
};

}  // namespace limn::session
