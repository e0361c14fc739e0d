#include "projector/composite_policy.h"

#include <algorithm>

#include "core/result.h"

namespace limn::projector {

std::vector<CompositePolicy> updated_policies(std::span<const CompositePolicy> before,
                                              std::span<const PartCoverage> coverage,
                                              double seconds,
                                              const CompositePolicyOptions& options) {
  LIMN_CHECK(options.full_below <= options.rest_above && options.hold_s >= 0 && options.fade_s > 0);
  std::vector<CompositePolicy> after(before.begin(), before.end());
  for (CompositePolicy& treatment : after) {
    treatment.for_s += seconds;
    treatment.passing = std::max(0.0, treatment.passing - seconds / options.fade_s);
  }
  for (const PartCoverage& part : coverage) {
    if (part.viewer_pixels == 0) continue;
    const double share = part.on_surface_share;
    const auto known = std::find_if(after.begin(), after.end(),
                                    [&](const CompositePolicy& t) { return t.slot == part.slot; });
    if (known == after.end()) {
      const bool is_lit = share >= 0.5 * (options.full_below + options.rest_above);
      after.push_back({part.slot, is_lit ? Composite::rest : Composite::full, 0});
      continue;
    }
    const bool wants_other =
        known->what == Composite::rest ? share < options.full_below : share > options.rest_above;
    if (!wants_other || known->for_s < options.hold_s) continue;
    known->what = known->what == Composite::rest ? Composite::full : Composite::rest;
    known->for_s = 0;
    known->passing = 1 - known->passing;
  }
  return after;
}

}  // namespace limn::projector
