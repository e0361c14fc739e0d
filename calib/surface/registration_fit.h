#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/surface/registration.h"

namespace limn::calib {

// The fit of a mesh to a scan, which the functions of registration.h, global_registration.h and
// scan_overlap.h share.

/// The least number of points of a fit, for six parameters.
constexpr int k_least_fit_points = 30;

/// The diagonal of the box around points.
double diagonal_of(const std::vector<Eigen::Vector3f>& positions);

/// "12.3 mm", "1.23 m"
std::string size_text(double metres);

/// A point of a scan and its normal, of length 1.
struct ScanPoint {
  Eigen::Vector3d p, n;
};

/// A cell of a grid over the scan.
using ScanCell = std::array<int, 3>;
ScanCell scan_cell_of(const Eigen::Vector3d& p, double size);

/// One point of each cell of the size `cell`, m: the most accurate.
std::vector<ScanPoint> thinned(const scene::ScanSurface& scan, double cell);

/// Distance of a point (prototype frame) from the mesh along its normal; nullopt beyond `reach` or the mesh's
/// end.
struct MeshOffset {
  double distance = 0;
  Eigen::Vector3d d_normal;
};
std::optional<MeshOffset> off_mesh(const scene::MeshBvh& index,
                                   const Eigen::Vector3d& p,
                                   const Eigen::Vector3d& d_facing,
                                   double reach);

/// A scan point's residual.
struct FitRow {
  // Derivative of the residual by boxplus's perturbation with rotations about `pivot`, times radius.
  Vector6d jacobian;
  double residual = 0, weight = 1;
  double slope = 1;   // derivative of weight x residual by the residual
  Eigen::Vector3d p;  // world
};

/// Weighted residuals of the points within `reach` of the mesh.
std::vector<FitRow> fit_rows(const scene::MeshBvh& index,
                             const std::vector<ScanPoint>& points,
                             const Pose& world_from_prototype,
                             double reach);

/// The frame and unit of rotations: about the centre of the points, in metres at their radius, so that all
/// six parameters have the same unit.
struct FitGauge {
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  double radius = 1;
};

/// The state of the fit.
struct RegistrationFit {
  Pose pose;
  FitGauge gauge;
  std::vector<FitRow> rows;
  double scale = 0;
  int iterations = 0;
};

/// The fit from a start; nullopt where fewer than k_least_fit_points lie within `reach`, m, of the mesh.
std::optional<RegistrationFit> fit_registration(const scene::MeshBvh& index,
                                                const std::vector<ScanPoint>& points,
                                                const Pose& start,
                                                double reach,
                                                int max_iterations);

/// The result of a fit, with its covariance (RegistrationOptions::free_stddev_m) and free directions.
Registration registration_of(const RegistrationFit& fit, double mesh_diagonal, double free_stddev_m);

}  // namespace limn::calib
