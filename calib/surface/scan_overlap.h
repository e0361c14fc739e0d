#pragma once

#include <vector>

#include "calib/surface/registration.h"

namespace limn::calib {

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
