#include "tracker/exclusion_zone.h"

#include <algorithm>

namespace limn::tracker {
namespace {

constexpr double k_around_px = 3;  // width around the square that belongs to it

}  // namespace

ExclusionZone::ExclusionZone(const Detection& detection) : corner_(detection.corners_px[0]) {
  const auto& c = detection.corners_px;
  middle_ = 0.25 * (c[0] + c[1] + c[2] + c[3]);
  double longest_square = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d side = c[(i + 1) % 4] - c[i];
    longest_square = std::max(longest_square, side.squaredNorm());
    inward_[i] = Eigen::Vector2d(-side.y(), side.x()).normalized();
    offset_[i] = inward_[i].dot(c[i]) - k_around_px;
  }
  half_square_ = 0.25 * longest_square;
  around_square_ = 4 * longest_square;
}

bool ExclusionZone::holds_both_ends(const Segment& segment) const {
  for (std::size_t i = 0; i < 4; ++i)
    if (std::min(inward_[i].dot(segment.from), inward_[i].dot(segment.to)) < offset_[i]) return false;
  return true;
}

bool ExclusionZone::takes(const Quad& quad) const {
  const auto& q = quad.corners_px;
  return (0.25 * (q[0] + q[1] + q[2] + q[3]) - middle_).squaredNorm() < half_square_;
}

}  // namespace limn::tracker
