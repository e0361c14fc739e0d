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

/// The result of a registration without a start.
struct GlobalRegistration {
  Registration registration;
  /// The next best pose that is a different one, and its points in the fit as a share of the best pose's.
  /// Near 1 the shape is symmetric.
  std::optional<Pose> rival;
  double rival_share = 0;
};

/// Tries evenly spread rotations (Alexa 2022, super-Fibonacci spirals). For each, the middle of the mesh's
/// side that would face the scanner is placed on the middle of each of the scan's larger connected pieces and
/// beside it. The best by a truncated distance field get short fits, the best of these
/// `refined_registration`. Takes some seconds. Error: in no pose does a fair share of any piece lie on the
/// mesh.
Result<GlobalRegistration> global_registration(const scene::Mesh& mesh,
                                               const scene::MeshBvh& index,
                                               const scene::ScanSurface& scan,
                                               const RegistrationOptions& options = {});

/// An error when the sizes of mesh and scan cannot belong to one object: wrong units.
Status comparable_sizes(const scene::Mesh& mesh, const scene::ScanSurface& scan);

/// Distance of every scan point from the mesh along its normal, m, positive outside; NaN where the mesh is
/// further away than `reach_m` or ends. Indices are those of the scan's points.
std::vector<float> residuals(const scene::MeshBvh& index,
                             const scene::ScanSurface& scan,
                             const Registration& registration,
                             double reach_m);

/// How much of the scan and of the mesh lie on each other.
struct Overlap {
  double scan_share = 0;  ///< share of the scan's points, one for each cell of the fit, near the mesh
  double mesh_share =
      0;                ///< share of the mesh's area near the scan; at most about half for a scan of one side
  double near_m = 0;    ///< the distance that counts as near: 1 % of the mesh's diagonal, at least 3 mm
  int scan_points = 0;  ///< number of points that scan_share is a share of
};

/// Measures it at the registration's pose. Near means on the same side of both surfaces, too.
Overlap overlap(const scene::Mesh& mesh,
                const scene::MeshBvh& index,
                const scene::ScanSurface& scan,
                const Pose& world_from_prototype,
                const RegistrationOptions& options = {});

/// Whether this is a registration of one object: fails when little of the scan lies on the mesh and little of
/// the mesh on the scan, as it is for another object. A scan of a whole room passes by the mesh's share, a
/// scan of a detail by the scan's.
Status check_overlap(const Overlap& overlap);

/// A connected region of the scan that differs from the mesh.
struct Difference {
  Eigen::Vector3d p_prototype = Eigen::Vector3d::Zero();  ///< centre of the region
  double area_m2 = 0;
  double mean_m = 0;   ///< signed, positive outside
  double worst_m = 0;  ///< signed
};

struct DifferenceOptions {
  double least_m = 1e-3;        ///< smaller differences are ignored
  double sigmas = 4;            ///< so are those within this many standard deviations of point and pose
  double least_area_m2 = 5e-5;  ///< smaller regions are noise at edges
};

/// Regions of triangles whose corners are all beyond the limits on the same side, largest first.
std::vector<Difference> differences(const scene::ScanSurface& scan,
                                    const std::vector<float>& residuals,
                                    const Registration& registration,
                                    const DifferenceOptions& options = {});

}  // namespace limn::calib
