#pragma once

#include <Eigen/Core>
#include <bitset>
#include <cstddef>
#include <span>
#include <vector>

namespace limn::tracker {

/// Equal parts of an outline by the direction from its centre in the image; the first begins at the direction
/// -pi.
inline constexpr std::size_t k_outline_parts = 32;
using OutlineParts = std::bitset<k_outline_parts>;

/// The part in the direction of a vector.
std::size_t outline_part(const Eigen::Vector2d& from_centre);

/// A circle that a part of a boundary runs along.
struct CircleArcs {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0;
  OutlineParts parts;  ///< where the boundary runs along it, and nothing else lies beside it
};

/// Finds the circles of which a closed boundary, given by points in its order, shows at least 60 %: the whole
/// of a ball's outline but for what something before it hides, and the outlines of balls that touch.
/// `beside`: other points of the boundary within this distance outside a circle block its parts. Radii from
/// `min_radius` to `max_radius`. At most four circles, the most complete first. The points must be so few
/// that trying all pairs of them is fast (64).
std::vector<CircleArcs> circles_along(std::span<const Eigen::Vector2d> boundary,
                                      double min_radius,
                                      double max_radius,
                                      double beside);

}  // namespace limn::tracker
