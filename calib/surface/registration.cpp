#include "calib/surface/registration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/surface/registration_fit.h"
#include "core/linear_algebra.h"

namespace limn::calib {

Result<Registration> refined_registration(const scene::Mesh& mesh,
                                          const scene::MeshBvh& index,
                                          const scene::ScanSurface& scan,
                                          const Pose& start,
                                          const RegistrationOptions& options) {
  const double size = diagonal_of(mesh.positions);
  const auto points = thinned(scan, options.cell * size);
  constexpr int k_goes = 3;
  // Reach of the next attempt as a share: far points slow down the last millimetres.
  constexpr double k_narrower = 0.25;
  double reach = options.reach * size;
  auto fit = fit_registration(index, points, start, reach, options.max_iterations);
  for (int go = 1; go < k_goes && fit && fit->iterations == options.max_iterations; ++go) {
    reach *= k_narrower;
    fit = fit_registration(index, points, fit->pose, reach, options.max_iterations);
  }
  if (!fit)
    return error(
        "expected at least {} scan points within {} of the mesh at the start that face the same way, found "
        "fewer. Check the start and the units; a mesh whose triangles are inside out does not fit.",
        k_least_fit_points, size_text(options.reach * size));
  return registration_of(*fit, size, options.free_stddev_m);
}

Result<Pose> pose_from_picks(const std::vector<Pick>& picks, double max_apart_m) {
  if (picks.size() < 3)
    return error("expected at least 3 picked pairs, found {}. Pick more, spread over the prototype.",
                 picks.size());
  Eigen::Matrix3Xd a(3, static_cast<Eigen::Index>(picks.size())), b = a;
  for (std::size_t i = 0; i < picks.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = picks[i].p_prototype;
    b.col(static_cast<Eigen::Index>(i)) = picks[i].p_world;
  }
  const Eigen::Vector3d mean_a = a.rowwise().mean(), mean_b = b.rowwise().mean();
  const Eigen::Matrix3Xd da = a.colwise() - mean_a, db = b.colwise() - mean_b;
  for (const Eigen::Matrix3d& scatter :
       {Eigen::Matrix3d(da * da.transpose()), Eigen::Matrix3d(db * db.transpose())}) {
    const Eigen::Vector3d squares = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
    if (!(std::sqrt(std::max(0.0, squares[1])) > 0.02 * std::sqrt(squares[2])))
      return error(
          "the picked points lie on one line: the rotation about it is undetermined. Pick a point beside "
          "it.");
  }
  const Eigen::Matrix3d rotation = nearest_rotation(db * da.transpose());
  const Pose pose(rotation, mean_b - rotation * mean_a);
  Eigen::Index worst = 0;
  const double apart = (b - ((rotation * a).colwise() + pose.translation)).colwise().norm().maxCoeff(&worst);
  if (apart > max_apart_m)
    return error(
        "pair {}: after the best fit of all {} pairs its points are {:.0f} mm apart. Check this pair, the "
        "order, and the units of the CAD points.",
        worst, picks.size(), 1e3 * apart);
  return pose;
}

Status comparable_sizes(const scene::Mesh& mesh, const scene::ScanSurface& scan) {
  constexpr double k_plausible = 50;  // ratio; a wrong unit gives 25 or more, a room around a part less
  const double cad = diagonal_of(mesh.positions), seen = diagonal_of(scan.positions);
  if (!(cad > 0) || !(seen > 0))
    return error("expected a mesh and a scan with extent, found sizes {} m and {} m.", cad, seen);
  const double ratio = cad / seen;
  if (ratio < k_plausible && ratio > 1 / k_plausible) return {};
  const bool larger = ratio > 1;
  const double factor = larger ? ratio : 1 / ratio;
  // A round factor when a unit explains it: a scan is one to some times as large as the prototype.
  const bool thousand = factor > 150 && factor < 5000;
  return error("the CAD is {} times {} than the scan ({} against {}): check --units.",
               thousand ? std::string("about 1000") : fmt::format("{:.0f}", factor),
               larger ? "larger" : "smaller", size_text(cad), size_text(seen));
}

}  // namespace limn::calib
