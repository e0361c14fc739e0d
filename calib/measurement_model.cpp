#include "calib/measurement_model.h"

#include <Eigen/Dense>
#include <cmath>

namespace limn::calib {
namespace {

constexpr double k_least_parallax = 0.01;  // rad between two rays; below, the depth is too uncertain

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Derivative of a point R p + t by boxplus's perturbation: w x (R p) + v, as a 3x6 matrix. `arm` is R p.
Eigen::Matrix<double, 3, 6> moved_by_pose(const Vector3d& arm) {
  Eigen::Matrix<double, 3, 6> m;
  m << -cross_matrix(arm), Matrix3d::Identity();
  return m;
}

// Intersection of a camera ray with the board.
struct Hit {
  Vector3d p_camera, p_world, p_board;
  double distance = 0;  // in units of the ray's d
};

bool cast(const ImagerView& camera,
          const Pose& world_from_board,
          const BoardShape& shape,
          const Vector2d& bend,
          const Vector3d& d_camera,
          Hit* hit) {
  const Pose world_from_camera = camera.imager_from_world.inverse();
  const Pose board_from_camera = world_from_board.inverse() * world_from_camera;
  const Vector3d p_origin = board_from_camera.translation, d = board_from_camera.rotation * d_camera;
  if (std::abs(d.z()) < 1e-9) return false;
  double distance = -p_origin.z() / d.z();
  for (int i = 0; i < 20; ++i) {  // Newton on z - sheet(x, y); the sheet is nearly flat
    const Vector3d p = p_origin + distance * d;
    const double gap = p.z() - shape.z(bend, p.x(), p.y());
    const double rate = d.z() - shape.slope(bend, p.x(), p.y()).dot(d.head<2>());
    if (std::abs(rate) < 1e-9) return false;
    const double step = gap / rate;
    distance -= step;
    if (std::abs(step) < 1e-13) break;
  }
  if (!(distance > 0) || !std::isfinite(distance)) return false;
  hit->distance = distance;
  hit->p_camera = distance * d_camera;
  hit->p_world = world_from_camera * hit->p_camera;
  hit->p_board = p_origin + distance * d;
  return true;
}

// Newton's method from the ray's d; false when it does not converge in some steps.
bool refine_ray(const LensModel& model,
                std::span<const double> values,
                const Vector2d& px,
                bool with_derivatives,
                LensRay* ray) {
  constexpr double k_tolerance_px = 1e-9;
  constexpr int k_most_steps = 6;
  Derivatives::Values by_values(2, static_cast<Eigen::Index>(values.size()));
  Matrix23 by_d;
  Vector2d found;
  for (int step = 0; step <= k_most_steps; ++step) {
    if (!model.project(values, ray->d, &found, by_d.data(), with_derivatives ? by_values.data() : nullptr))
      return false;
    const Eigen::Matrix2d inverse = by_d.leftCols<2>().inverse();
    const Vector2d error = px - found;
    if (error.cwiseAbs().maxCoeff() < k_tolerance_px) {
      if (with_derivatives) ray->xy_by_values.noalias() = -inverse * by_values;
      return inverse.allFinite();
    }
    ray->d.head<2>() += inverse * error;
  }
  return false;
}

}  // namespace

double BoardShape::z(const Vector2d& bend, double x, double y) const {
  return bend.dot(per_bend(x, y)) + twist_m * per_twist(x, y);
}

double BoardShape::per_twist(double x, double y) const {
  return (2 * x / width_m - 1) * (2 * y / height_m - 1);
}

Vector2d BoardShape::slope(const Vector2d& bend, double x, double y) const {
  const double xr = 2 * x / width_m - 1, yr = 2 * y / height_m - 1;
  return {(-4 * bend.x() * xr + 2 * twist_m * yr) / width_m,
          (-4 * bend.y() * yr + 2 * twist_m * xr) / height_m};
}

Vector2d BoardShape::per_bend(double x, double y) const {
  const double xr = 2 * x / width_m - 1, yr = 2 * y / height_m - 1;
  return {1 - xr * xr, 1 - yr * yr};
}

bool predict_corner(const ImagerView& camera,
                    const Pose& world_from_board,
                    const BoardShape& shape,
                    const Vector2d& bend,
                    const Vector2d& p_board_xy,
                    Vector2d* px,
                    Derivatives* derivatives) {
  const double x = p_board_xy.x(), y = p_board_xy.y();
  const Vector3d arm_board = world_from_board.rotation * Vector3d(x, y, shape.z(bend, x, y));
  const Vector3d arm_camera = camera.imager_from_world.rotation * (arm_board + world_from_board.translation);
  const Vector3d p_camera = arm_camera + camera.imager_from_world.translation;
  if (!(p_camera.z() > 0)) return false;
  if (!derivatives) return camera.model.project(camera.values, p_camera, px);
  Matrix23 by_p;
  derivatives->camera_values.resize(2, static_cast<Eigen::Index>(camera.values.size()));
  if (!camera.model.project(camera.values, p_camera, px, by_p.data(), derivatives->camera_values.data()))
    return false;
  const Matrix23 by_world = by_p * camera.imager_from_world.rotation_matrix();
  derivatives->camera_pose = by_p * moved_by_pose(arm_camera);
  derivatives->board_pose = by_world * moved_by_pose(arm_board);
  const Vector2d by_height = by_world * (world_from_board.rotation * Vector3d::UnitZ());
  derivatives->bend = by_height * shape.per_bend(x, y).transpose();
  derivatives->twist = by_height * shape.per_twist(x, y);
  derivatives->board_xy = (by_world * world_from_board.rotation_matrix()).leftCols<2>() +
                          by_height * shape.slope(bend, x, y).transpose();
  return true;
}

bool find_ray(const LensModel& model,
              std::span<const double> values,
              const Vector2d& px,
              bool with_derivatives,
              LensRay* ray) {
  if (ray->d.z() == 1 && refine_ray(model, values, px, with_derivatives, ray)) return true;
  Vector3d d;
  ray->d.setZero();
  if (!model.unproject(values, px, &d) || !(d.z() > 0)) return false;
  ray->d = d / d.z();
  ray->d.z() = 1;
  if (refine_ray(model, values, px, with_derivatives, ray)) return true;
  ray->d.setZero();
  return false;
}

bool intersect_board(const ImagerView& camera,
                     const Pose& world_from_board,
                     const BoardShape& shape,
                     const Vector2d& bend,
                     const Vector2d& px_camera,
                     Vector3d* p_world) {
  LensRay ray;
  Hit hit;
  if (!find_ray(camera.model, camera.values, px_camera, false, &ray)) return false;
  if (!cast(camera, world_from_board, shape, bend, ray.d, &hit)) return false;
  *p_world = hit.p_world;
  return true;
}

bool predict_match(const ImagerView& camera,
                   const ImagerView& projector,
                   const Pose& world_from_board,
                   const BoardShape& shape,
                   const Vector2d& bend,
                   const Vector2d& px_camera,
                   Vector2d* px_projector,
                   Derivatives* derivatives) {
  LensRay ray;
  return find_ray(camera.model, camera.values, px_camera, derivatives != nullptr, &ray) &&
         predict_match(camera, projector, world_from_board, shape, bend, ray, px_projector, derivatives);
}

bool predict_match(const ImagerView& camera,
                   const ImagerView& projector,
                   const Pose& world_from_board,
                   const BoardShape& shape,
                   const Vector2d& bend,
                   const LensRay& ray,
                   Vector2d* px_projector,
                   Derivatives* derivatives) {
  Hit hit;
  if (!cast(camera, world_from_board, shape, bend, ray.d, &hit)) return false;
  const Vector3d arm_projector = projector.imager_from_world.rotation * hit.p_world;
  const Vector3d p_projector = arm_projector + projector.imager_from_world.translation;
  if (!(p_projector.z() > 0)) return false;
  if (!derivatives) return projector.model.project(projector.values, p_projector, px_projector);

  Matrix23 by_p;
  derivatives->projector_values.resize(2, static_cast<Eigen::Index>(projector.values.size()));
  if (!projector.model.project(projector.values, p_projector, px_projector, by_p.data(),
                               derivatives->projector_values.data()))
    return false;

  // The point stays on the sheet: n . (its movement relative to the board) = movement of the sheet along
  // z_board.
  const Matrix3d world_from_camera = camera.imager_from_world.rotation_matrix().transpose();
  const Vector2d slope = shape.slope(bend, hit.p_board.x(), hit.p_board.y());
  const Vector3d n_world = world_from_board.rotation * Vector3d(-slope.x(), -slope.y(), 1);
  const Vector3d d_world = world_from_camera * ray.d;
  const double rate = n_world.dot(d_world);
  const Vector3d arm_board = hit.p_world - world_from_board.translation;
  const Vector3d arm_camera = hit.p_camera - camera.imager_from_world.translation;
  // A movement m of the ray's point that ignores the board becomes m - d (n.m)/(n.d).
  const Matrix3d along_sheet = Matrix3d::Identity() - d_world * n_world.transpose() / rate;
  const Matrix23 by_world = by_p * projector.imager_from_world.rotation_matrix();
  const Matrix23 by_camera = by_world * along_sheet * world_from_camera;

  derivatives->projector_pose = by_p * moved_by_pose(arm_projector);
  derivatives->camera_values.noalias() = hit.distance * by_camera.leftCols<2>() * ray.xy_by_values;
  derivatives->camera_pose = -by_camera * moved_by_pose(arm_camera);
  const Vector2d by_distance = by_world * d_world / rate;
  derivatives->board_pose = by_distance * (n_world.transpose() * moved_by_pose(arm_board));
  derivatives->bend = by_distance * shape.per_bend(hit.p_board.x(), hit.p_board.y()).transpose();
  derivatives->twist = by_distance * shape.per_twist(hit.p_board.x(), hit.p_board.y());
  return true;
}

bool predict_tie_point(const ImagerView& camera,
                       const ImagerView& seeing,
                       const LensRay& ray,
                       double inverse_depth,
                       Vector2d* px,
                       TiePointDerivatives* derivatives) {
  if (!(inverse_depth > 0)) return false;
  const Vector3d p_camera = ray.d / inverse_depth;
  const Matrix3d world_from_camera = camera.imager_from_world.rotation_matrix().transpose();
  const Vector3d arm_camera = p_camera - camera.imager_from_world.translation;
  const Vector3d arm = seeing.imager_from_world.rotation * (world_from_camera * arm_camera);
  const Vector3d p = arm + seeing.imager_from_world.translation;
  if (!(p.z() > 0)) return false;
  if (!derivatives) return seeing.model.project(seeing.values, p, px);
  Matrix23 by_p;
  derivatives->values.resize(2, static_cast<Eigen::Index>(seeing.values.size()));
  if (!seeing.model.project(seeing.values, p, px, by_p.data(), derivatives->values.data())) return false;
  const Matrix23 by_camera = by_p * seeing.imager_from_world.rotation_matrix() * world_from_camera;
  derivatives->pose = by_p * moved_by_pose(arm);
  derivatives->camera_pose = -by_camera * moved_by_pose(arm_camera);
  derivatives->camera_values.noalias() = by_camera.leftCols<2>() * ray.xy_by_values / inverse_depth;
  derivatives->inverse_depth = -by_camera * ray.d / (inverse_depth * inverse_depth);
  return true;
}

double triangulated_depth(const ImagerView& camera,
                          const LensRay& ray,
                          const ImagerView& seeing,
                          const Vector2d& px) {
  LensRay other;
  if (!find_ray(seeing.model, seeing.values, px, false, &other)) return 0;
  const Pose camera_from_seeing = camera.imager_from_world * seeing.imager_from_world.inverse();
  const Vector3d a = ray.d, b = camera_from_seeing.rotation * other.d, o = camera_from_seeing.translation;
  const double aa = a.dot(a), bb = b.dot(b), ab = a.dot(b), determinant = aa * bb - ab * ab;
  if (!(determinant > k_least_parallax * k_least_parallax * aa * bb)) return 0;
  const double depth = (a.dot(o) * bb - b.dot(o) * ab) / determinant;
  return std::isfinite(depth) && depth > 0 ? depth : 0;
}

}  // namespace limn::calib
