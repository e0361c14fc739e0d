#pragma once

#include <span>
#include <string>
#include <vector>

#include "projector/renderer.h"

namespace limn::projector {

/// When the screen draws a whole part, and when only what projected light cannot show.
struct CompositePolicyOptions {
  /// Below this share of a part's viewer pixels that light shows, it becomes `full`.
  double full_below = 0.3;
  double rest_above = 0.5;  ///< Above this share it becomes `rest`. Between the two limits it stays as it is.
  double hold_s = 2;        ///< Least time between two changes, whatever the coverage.
  double fade_s = 0.4;  ///< Duration of the cross-fade. Longer is calmer, but shows parts twice for longer.
};

/// How the screen treats the part of a slot.
struct CompositePolicy {
  std::string slot;
  Composite what = Composite::rest;
  double for_s = 0;  ///< Time since the last change.
  /// Weight of the previous treatment in the cross-fade: 1 at a change, falling to 0 within fade_s.
  double passing = 0;

  /// Weight with which the screen also draws what light can show: 0 is `rest`, 1 is `full`.
  double full_weight() const { return what == Composite::full ? 1 - passing : passing; }
};

/// The policies `seconds` later, given the coverage at that time. A new slot is decided by the middle of the
/// two limits. A slot that is absent, or of which the viewer sees nothing, stays as it is, so that a marker
/// lost for a moment changes nothing. A slot changes at most once in hold_s; a change during a cross-fade
/// starts from the current weights.
std::vector<CompositePolicy> updated_policies(std::span<const CompositePolicy> before,
                                              std::span<const PartCoverage> coverage,
                                              double seconds,
                                              const CompositePolicyOptions& options = {});

}  // namespace limn::projector
