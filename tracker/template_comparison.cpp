#include "tracker/template_comparison.h"

#include <algorithm>
#include <numeric>

#include "tracker/identify.h"

namespace limn::tracker {
namespace {

Discriminability telling_of(double correlation) {
  if (correlation > 1 - k_min_rotation_lead) return Discriminability::confused;
  return correlation >= k_min_correlation ? Discriminability::alike : Discriminability::apart;
}

// A template is compared with itself only in other rotations.
TemplateSimilarity likeness(const TemplatePattern& a, const TemplatePattern& b, bool is_itself) {
  TemplateSimilarity most{a.id, b.id, 0, -2, Discriminability::apart};
  for (std::size_t k = is_itself ? 1 : 0; k < 4; ++k) {
    const auto& upright = a.rotations[0];
    const double correlation =
        std::inner_product(upright.begin(), upright.end(), b.rotations[k].begin(), 0.0);
    if (correlation <= most.correlation) continue;
    most.correlation = correlation;
    most.quarter_turns = static_cast<int>(k);
  }
  most.telling = telling_of(most.correlation);
  return most;
}

}  // namespace

std::vector<TemplateSimilarity> compared(std::span<const TemplatePattern> templates) {
  std::vector<TemplateSimilarity> all;
  for (std::size_t i = 0; i < templates.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      LIMN_CHECK(templates[i].size == templates[j].size);
      all.push_back(likeness(templates[j], templates[i], i == j));
    }
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return a.correlation > b.correlation; });
  return all;
}

}  // namespace limn::tracker
