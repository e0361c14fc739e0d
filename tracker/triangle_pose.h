#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "core/lens.h"
#include "core/pose.h"

namespace limn::tracker {

// The pose of the 2011 paper (Stastny, Prochazka, Koubek, Landa, "Augmented reality usage for prototyping
// speed up"): a coordinate system is built on three of the marker's points, once in marker coordinates (A)
// and once in camera coordinates (B). The motion takes one to the other.
//
// The paper prints Theta, a 4x4 matrix with a skew-symmetric block, as if it were the motion. It is not:
// Theta is the GENERATOR of the motion, its twist. The motion is T = exp(Theta), and only for small angles is
// T close to I + Theta. twist() and exp_twist() convert in the two directions.

/// Three points that are not on one line.
using Triangle = std::array<Eigen::Vector3d, 3>;

enum class TriangleOrigin {
  vertex,        ///< the triangle's first point
  centroid,      ///< its centre of gravity
  side_midpoint  ///< the middle of the side from the first to the second point
};

struct TriangleOptions {
  TriangleOrigin origin = TriangleOrigin::centroid;
  /// The side whose direction is the first axis: i from point i to point (i + 1) % 3.
  int first_axis = 0;
  /// The third axis is the triangle's normal, by the right hand rule along its points; true reverses it (and
  /// the second axis with it).
  bool flip_normal = false;
};

/// The triangle's own coordinate system: parent_from_triangle. nullopt when its points lie on a line.
std::optional<Pose> triangle_frame(const Triangle& triangle, const TriangleOptions& options = {});

/// camera_from_marker from the same triangle in both frames: R = B A^-1 with the frames' axes as columns of B
/// (camera) and A (marker), t = origin_camera - R origin_marker. For exact points all options give the same
/// motion; with noise they weight the points differently.
std::optional<Pose> pose_from_triangles(const Triangle& in_marker,
                                        const Triangle& in_camera,
                                        const TriangleOptions& options = {});

/// Theta = log(T): [ [w]x v ; 0 0 ], the twist whose exponential is the motion. |w| <= pi.
Eigen::Matrix4d twist(const Pose& motion);

/// T = exp(Theta) in closed form (Rodrigues). Theta must be a twist as twist() makes it.
Pose exp_twist(const Eigen::Matrix4d& theta);

/// The marker's corners in camera coordinates (m), from their pixels and the known side alone. Opposite sides
/// of a square are equal vectors, p0 - p1 + p2 - p3 = 0, which gives the four depths except for a scale; the
/// side's length gives the scale. nullopt when the corners are degenerate or a depth is not positive.
std::optional<std::array<Eigen::Vector3d, 4>> recovered_corners(
    const Lens& lens, double size_m, const std::array<Eigen::Vector2d, 4>& corners_px);

/// The paper's whole method: recovered corners, three of them (without corner `omitted_corner`), their
/// frames, the motion.
std::optional<Pose> triangle_pose(const Lens& lens,
                                  double size_m,
                                  const std::array<Eigen::Vector2d, 4>& corners_px,
                                  const TriangleOptions& options = {},
                                  std::size_t omitted_corner = 3);

}  // namespace limn::tracker
