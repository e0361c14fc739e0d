#pragma once

#include <span>
#include <string>
#include <vector>

#include "tracker/family.h"

namespace limn::tracker {

/// How well two templates, or a template and its own rotations, can be told apart. The limits are the
/// detector's own (identify.h).
enum class Discriminability {
  apart,  ///< correlation below k_min_correlation: neither is ever read in place of the other
  alike,  ///< the other one can be read in its place when it is not loaded or is badly visible
  /// They differ by less than k_min_rotation_lead, so noise decides; a template that is like its own rotation
  /// is never read
  confused
};

struct TemplateSimilarity {
  std::string a, b;        ///< ids; equal for a template and its own rotation
  int quarter_turns = 0;   ///< rotation of b, clockwise, at which they are most alike; 1 to 3 when a is b
  double correlation = 0;  ///< -1 … 1
  Discriminability telling = Discriminability::apart;
};

/// Every pair of templates, and every template with itself, each at its most similar rotation; sorted, most
/// similar first. All must have the same size.
std::vector<TemplateSimilarity> compared(std::span<const TemplatePattern> templates);

}  // namespace limn::tracker
