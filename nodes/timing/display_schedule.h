#pragma once

#include <deque>
#include <optional>

#include "core/frame.h"

namespace limn::nodes {

/// Says when a display must be called so that its light appears at a wanted moment. Each display has its own.
///
/// Two kinds of displays are told apart by what they did before. One shows each image a fixed time after the
/// call; the call is then made that much earlier. The other shows it at its next refresh; the call is then
/// made in the middle between two refreshes, so that the refresh nearest to the wanted moment is met whatever
/// the call's own jitter.
class DisplaySchedule {
 public:
  /// When show() must be called for light at `wanted`; both on this machine's clock.
  Stamp call_at(Stamp wanted) const;
  /// Whether the light would be later than wanted by more than half a frame of 60 Hz if show() were called
  /// now.
  bool is_too_late(Stamp wanted, Stamp now) const;
  /// Notes a call and the moment of its light, which show() returned.
  void note(Stamp called_at, Stamp shown_at);

  /// The delay from a call to its light: the mean of those noted last; 0 before the first.
  double latency_s() const;
  /// The time between two refreshes; nullopt: the display has none, or it is not known yet.
  std::optional<double> refresh_s() const { return refresh_s_; }
  /// The light of the last image, on this machine's clock; at a refresh, if there are some.
  Stamp last_shown_at() const { return shown_.empty() ? Stamp() : shown_.back().shown_at; }

 private:
  struct Shown {
    Stamp called_at, shown_at;
  };
  bool is_in_phase(double rate_hz) const;
  void find_refresh();

  std::deque<Shown> shown_;     // oldest first
  double least_latency_s_ = 0;  // among all calls: one just before a refresh
  std::optional<double> refresh_s_;
};

}  // namespace limn::nodes
