#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "tracker/code_grid.h"

namespace limn::tracker {

/// A family of AprilTag 3. Its markers are light squares on dark: a white border, one cell wide, with cells
/// inside of it, in a black ring, with further cells around that. Limn reads them in the inverted image, and
/// describes them as they look there.
struct ApriltagCodes {
  CodeGrid grid;
  /// By id, as in CodeFamily: the marker upright as AprilTag's own apriltag_to_image draws it, inverted (1 is
  /// black in print).
  std::vector<std::uint64_t> codes;
  int distance = 0;  ///< smallest number of bits in which two codes differ, in any rotation
};

/// `apriltag_41h12` (tagStandard41h12, 2115 ids), `apriltag_52h13` (tagStandard52h13, 48714 ids),
/// `apriltag_48h12` (tagCustom48h12, 42211 ids, a hole of 2 x 2 cells in its middle), `apriltag_49h12`
/// (tagCircle49h12, 65535 ids) and `apriltag_21h7` (tagCircle21h7, 38 ids), which fit into a circle.
std::span<const std::string_view> apriltag3_families();

/// The codes of one of them, from the tables of AprilTag's library. `name` must be one of
/// apriltag3_families().
ApriltagCodes apriltag3_codes(std::string_view name);

}  // namespace limn::tracker
