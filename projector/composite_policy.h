#pragma once

#include <span>
#include <string>
#include <vector>

#include "projector/renderer.h"

namespace limn::projector {

/// When the screen draws a part whole, and when it leaves to light what light can show.
struct CompositePolicyOptions {
  double full_below = 0.3;  ///< of a part's viewer pixels shown by light: fewer make it `full`,
  double rest_above = 0.5;  ///< more make it `rest`; between the two it stays as it is
  double hold_s = 2;        ///< after a change it stays for so long, whatever its coverage
  double fade_s = 0.4;      ///< in which one passes into the other; longer: calmer, twice for longer
};

/// How the screen treats the part of a slot.
struct CompositePolicy {
  std::string slot;
  Composite what = Composite::rest;
  double for_s = 0;  ///< since it has been so
  /// Share of the other treatment that still shows: 1 at a change, falling to 0 within fade_s.
  double passing = 0;

  /// How much of what light can show the screen draws, too: 0 `rest` ... 1 `full`.
  double whole() const { return what == Composite::full ? 1 - passing : passing; }
};

/// The treatments `seconds` later, by the coverage found then. A slot that is met for the first time goes by
/// the middle of the two limits; one that is absent, or of which the viewer sees nothing, stays as it is, so
/// that a marker lost for a moment changes nothing. Between two changes of a slot lie hold_s or more; one
/// that comes before the last has passed goes on from what shows.
std::vector<CompositePolicy> updated_policies(std::span<const CompositePolicy> before,
                                              std::span<const PartCoverage> coverage,
                                              double seconds,
                                              const CompositePolicyOptions& options = {});

}  // namespace limn::projector
