#pragma once

#include <span>
#include <string>
#include <vector>

#include "tracker/family.h"

namespace limn::tracker {

/// How two templates, or one and itself turned, are told apart. The limits are the detector's own
/// (identify.h).
enum class Discriminability {
  apart,    ///< correlation below k_min_correlation: neither is ever read where the other lies
  alike,    ///< the other is read where this one lies and is not loaded, or is badly seen
  confused  ///< less than k_min_rotation_lead apart: noise decides; one turned like that is never read
};

struct TemplateSimilarity {
  std::string a, b;        ///< ids; the same for a template and itself turned
  int quarter_turns = 0;   ///< of b, clockwise, where they are most alike; 1 to 3 when a is b
  double correlation = 0;  ///< -1 … 1
  Discriminability telling = Discriminability::apart;
};

/// Every pair, and every template with itself, at its most alike rotation; most alike first. All must have
/// one size.
std::vector<TemplateSimilarity> compared(std::span<const TemplatePattern> templates);

}  // namespace limn::tracker
