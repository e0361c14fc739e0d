#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/imager.h"

namespace limn::calib {

/// A point seen by two imagers.
struct Triangulated {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  /// Covariance of p_world, m², from the pixels' variances alone.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// Epipolar residual: the distances of both reprojections from their pixels (root of the sum of squares),
  /// and the same in standard deviations (chi with one degree of freedom).
  double epipolar_px = 0;
  double epipolar_sigmas = 0;
  /// epipolar_sigmas with a sign: on which side of a's ray, as b sees it, the pixel of b lies. N(0, 1) if the
  /// pixels' variances are true; the distance of the point does not show in it.
  double epipolar_residual = 0;
  double angle = 0;  ///< between the two rays at the point, radians
};

/// A pixel and the variances of its two coordinates, px².
struct MeasuredPixel {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d variance = Eigen::Vector2d::Ones();
};

/// The point whose two reprojections through both lenses are nearest to the measured pixels, each coordinate
/// in units of its standard deviation (maximum likelihood; Hartley and Sturm 1997 with lenses): Gauss-Newton
/// from `p_start`. Covariance by first-order propagation. nullopt when the point has no pixel in one of them,
/// the steps do not converge, or the rays are too parallel to determine a point.
std::optional<Triangulated> triangulate(const Imager& a,
                                        const Imager& b,
                                        const MeasuredPixel& px_a,
                                        const MeasuredPixel& px_b,
                                        const Eigen::Vector3d& p_start);

/// The midpoint of the shortest line between two rays, a start for triangulate(). nullopt when they are
/// parallel or meet behind one of their origins.
std::optional<Eigen::Vector3d> midpoint(const Ray& a, const Ray& b);

}  // namespace limn::calib
