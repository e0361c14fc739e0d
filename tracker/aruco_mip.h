#pragma once

#include <cstdint>
#include <span>

namespace limn::tracker {

/// The codes of `aruco_mip_36h12`, OpenCV's DICT_ARUCO_MIP_36h12 (which Debian 12's OpenCV does not have
/// yet), by id: 6 x 6 cells row by row from the top left, first bit highest; 1 is white. Any two codes, in
/// any rotation, differ in at least 12 cells.
std::span<const std::uint64_t> aruco_mip_36h12();

}  // namespace limn::tracker
