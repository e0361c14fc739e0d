#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"
#include "scene/mesh.h"
#include "scene/mesh_bvh.h"
#include "scene/scan_surface.h"

namespace limn::calib {

struct RegistrationOptions {
  /// At the start a scan point belongs to the mesh when it is within this distance of it, as a share of the
  /// mesh's diagonal; later only within what the residuals say. Larger takes worse starts, and more of the
  /// room.
  double reach = 0.12;
  /// Points used for the fit: one in each cell of this share of the mesh's diagonal.
  double cell = 1 / 120.0;
  int max_iterations = 80;
};

/// Where a mesh stands in the scan's world, and how sure that is.
struct Registration {
  Pose world_from_prototype;
  /// Of boxplus's delta. From the residuals' own scatter, summed over cells of 1/20 of the mesh, so that
  /// errors shared by neighbouring points count as shared; 1 m (or as much at the mesh's radius) along what
  /// is free.
  Matrix6d covariance = Matrix6d::Zero();
  double rms_m = 0;  ///< distance of the points in the fit along the mesh's normals
  int used = 0;      ///< points in the fit
  int near = 0;      ///< points within its reach of the mesh
  /// What the shape does not hold, in words, in the prototype's frame: "slide along x", …
  std::vector<std::string> free_directions;
  int iterations = 0;
};

/// Lays the mesh onto the scan from a start: point to plane, from scan points to the mesh (so that a scan of
/// one side serves), the points' weights by Tukey's function of their residuals, the reach shrinking with
/// them (trimmed ICP). Directions that the shape does not hold keep the start's place. Error: too few scan
/// points near the mesh.
Result<Registration> refined_registration(const scene::Mesh& mesh,
                          const scene::MeshBvh& index,
                          const scene::ScanSurface& scan,
                          const Pose& start,
                          const RegistrationOptions& options = {});

/// A place on the mesh and the same place in the scan, m.
struct Pick {
  Eigen::Vector3d p_prototype = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
};

/// The rigid motion that brings the picks together (Kabsch). Errors: fewer than three, all on one line, or a
/// pair that stands out of the others by more than `max_apart_m`.
Result<Pose> pose_from_picks(const std::vector<Pick>& picks, double max_apart_m = 0.05);

/// A pose found without a start.
struct GlobalRegistration {
  Registration registration;
  /// The next best pose that is a different one, and its points in the fit as a share of the best's: near 1
  /// the shape is symmetric.
  std::optional<Pose> rival;
  double rival_share = 0;
};

/// Tries evenly spread turns (Alexa 2022, super-Fibonacci spirals), each with the middle of the mesh's side
/// that would face the scanner on the middle of each of the scan's larger connected pieces and beside it; the
/// best by a truncated distance field go on to short fits, the best of these to `aligned`. Some seconds.
/// Error: no pose lays a fair share of any piece onto the mesh.
Result<GlobalRegistration> global_registration(const scene::Mesh& mesh,
                             const scene::MeshBvh& index,
                             const scene::ScanSurface& scan,
                             const RegistrationOptions& options = {});

/// Says so when the mesh and the scan cannot be of one thing by their sizes: wrong units.
Status comparable_sizes(const scene::Mesh& mesh, const scene::ScanSurface& scan);

/// Distance of every scan point from the mesh along its normal, m, positive outside; NaN where the mesh is
/// further than `reach_m` or ends. The same index as the scan's points.
std::vector<float> residuals(const scene::MeshBvh& index,
                             const scene::ScanSurface& scan,
                             const Registration& registration,
                             double reach_m);

/// A connected region of the scan that is not where the mesh has it.
struct Difference {
  Eigen::Vector3d p_prototype = Eigen::Vector3d::Zero();  ///< its middle
  double area_m2 = 0;
  double mean_m = 0;   ///< signed, positive outside
  double worst_m = 0;  ///< signed
};

struct DifferenceOptions {
  double least_m = 1e-3;        ///< smaller differences are none
  double sigmas = 4;            ///< nor those within so many standard deviations of point and pose
  double least_area_m2 = 5e-5;  ///< smaller regions are noise at edges
};

/// Regions of triangles whose corners are all beyond the limits on the same side, the largest first.
std::vector<Difference> differences(const scene::ScanSurface& scan,
                                    const std::vector<float>& residuals,
                                    const Registration& registration,
                                    const DifferenceOptions& options = {});

}  // namespace limn::calib
