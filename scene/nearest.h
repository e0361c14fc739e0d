#pragma once

#include <Eigen/Core>

#include "scene/mesh.h"

namespace limn::scene {

/// A place on a mesh, in the mesh's frame (m).
struct SurfacePoint {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d d_normal = Eigen::Vector3d::UnitZ();  ///< unit, interpolated from the corners' normals
  std::size_t triangle = 0;
  double distance = 0;  ///< from the point asked for
};

/// The point of the mesh nearest to p. Looks at every triangle. The mesh must have
/// one.
SurfacePoint nearest_on(const Mesh& mesh, const Eigen::Vector3d& p);

}  // namespace limn::scene
