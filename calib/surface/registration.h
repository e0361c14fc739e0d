#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/mesh_bvh.h"
#include "scene/meshes/scan_surface.h"

namespace limn::calib {

struct RegistrationOptions {
  /// At the start a scan point belongs to the mesh when it is within this distance of it, as a share of the
  /// mesh's diagonal; later only within a limit that follows from the residuals. A larger value accepts worse
  /// starts, and more points of the room.
  double reach = 0.12;
  /// Points used for the fit: one in each cell of this size, as a share of the mesh's diagonal.
  double cell = 1 / 120.0;
  int max_iterations = 80;
  /// Standard deviation that is stated along directions that the shape does not determine, m (at the mesh's
  /// radius for rotations): how far the start may be off in them.
  double free_stddev_m = 1;
};

/// The pose of a mesh in the scan's world, and its uncertainty.
struct Registration {
  Pose world_from_prototype;
  /// Covariance of boxplus's perturbation. It follows from the residuals' own scatter, summed over cells of
  /// 1/20 of the mesh, so that errors shared by neighbouring points count as shared; along free directions
  /// RegistrationOptions::free_stddev_m.
  Matrix6d covariance = Matrix6d::Zero();
  double rms_m = 0;  ///< RMS distance of the points in the fit, along the mesh's normals
  int used = 0;      ///< number of points in the fit
  int near = 0;      ///< number of points within reach of the mesh
  /// Directions that the shape does not determine, as text, in the prototype's frame: "slide along x", …
  std::vector<std::string> free_directions;
  int iterations = 0;
};

/// Registers the mesh to the scan from a start (trimmed ICP): point to plane, from scan points to the mesh
/// (so that a scan of one side is enough), weights by Tukey's function of the residuals, with a reach that
/// shrinks with them. Along directions that the shape does not determine, the start is kept. Error: too few
/// scan points near the mesh.
Result<Registration> refined_registration(const scene::Mesh& mesh,
                                          const scene::MeshBvh& index,
                                          const scene::ScanSurface& scan,
                                          const Pose& start,
                                          const RegistrationOptions& options = {});

/// A point on the mesh and the same point in the scan, m.
struct Pick {
  Eigen::Vector3d p_prototype = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
};

/// The rigid motion that maps the picks onto each other (Kabsch). Errors: fewer than three, all on one line,
/// or a pair that differs from the others by more than `max_apart_m`.
Result<Pose> pose_from_picks(const std::vector<Pick>& picks, double max_apart_m = 0.05);

/// An error when the sizes of mesh and scan cannot belong to one object: wrong units.
Status comparable_sizes(const scene::Mesh& mesh, const scene::ScanSurface& scan);

}  // namespace limn::calib
