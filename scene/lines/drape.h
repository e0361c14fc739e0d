#pragma once

#include <Eigen/Core>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/lines/line.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

/// Lays curves on a mesh's surface. It has a copy of the mesh's shape; its search tree is made when it is
/// first used. Several threads may use it at once.
class Drape {
 public:
  explicit Drape(const Mesh& mesh);
  ~Drape();

  /// The curve laid on the surface: each point at the nearest place of the mesh, and further points between
  /// them, so that each piece follows the surface to within 0.1 mm. It stays on one side of a thin shell:
  /// a place on the side of the point before is preferred if it is at most 2 mm farther. Points that are
  /// equal to their neighbours are left out. Errors: points that are not finite or farther than 20 mm from
  /// the mesh; too few points; a result of more than k_most_points_laid. Messages begin with `where`.
  Result<SurfaceCurve> laid(const exchange::NamedCurve& curve, const std::string& where) const;

  /// The nearest point of the surface within `max_distance` (m), of the side `d_side` if it is not zero.
  std::optional<SurfacePoint> nearest(const Eigen::Vector3d& p,
                                      double max_distance,
                                      const Eigen::Vector3d& d_side = Eigen::Vector3d::Zero()) const;

  /// Where a ray from p along the unit direction d first meets the surface, within `max_distance` (m).
  std::optional<SurfacePoint> hit(const Eigen::Vector3d& p,
                                  const Eigen::Vector3d& d,
                                  double max_distance) const;

  /// The unit normal at the point of the surface nearest to p, interpolated from the corners; zero when it is
  /// farther than 20 mm.
  Eigen::Vector3d smooth_normal(const Eigen::Vector3d& p) const;

 private:
  struct Found {
    SurfacePoint point;
    double distance = 0;
  };
  std::optional<Found> find(const Eigen::Vector3d& p,
                            double max_distance,
                            const Eigen::Vector3d& d_side) const;
  std::optional<Found> find_beside(const Eigen::Vector3d& p, const SurfacePoint& before) const;
  void add_between(const SurfacePoint& a,
                   const SurfacePoint& b,
                   int depth,
                   std::vector<SurfacePoint>* to) const;

  struct Tree;
  const Tree& tree() const;

  Mesh mesh_;  // positions, normals and triangles alone
  mutable std::once_flag once_;
  mutable std::unique_ptr<Tree> tree_;
};

/// Whether neighbouring triangles of a mesh wind alike. Corners at the same position count as one.
bool winds_consistently(const Mesh& mesh);

/// Reads the files of lines and lays all curves, texts and dimensions on the prototype. Errors name the line.
Status lay_lines(const Drape& prototype, std::vector<Line>* lines);

}  // namespace limn::scene
