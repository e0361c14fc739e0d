#include "calib/predict.h"

#include <Eigen/Dense>
#include <cmath>

namespace limn::calib {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// How a point R p + t moves with boxplus's delta: w x (R p) + v, as a 3x6 matrix. `arm` is R p.
Eigen::Matrix<double, 3, 6> moved_by_pose(const Vector3d& arm) {
  Eigen::Matrix<double, 3, 6> m;
  m << -cross_matrix(arm), Matrix3d::Identity();
  return m;
}

// A camera ray on the board.
struct Hit {
  Vector3d d_camera, p_camera, p_world, p_board;
  double distance = 0;
};

bool cast(const ImagerView& camera,
          const Pose& world_from_board,
          const BoardShape& shape,
          const Vector2d& bend,
          const Vector2d& px_camera,
          Hit* hit) {
  if (!camera.model.unproject(camera.values, px_camera, &hit->d_camera)) return false;
  const Pose board_from_camera = (camera.imager_from_world * world_from_board).inverse();
  const Vector3d p_origin = board_from_camera.translation, d = board_from_camera.rotation * hit->d_camera;
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
  hit->p_camera = distance * hit->d_camera;
  hit->p_world = camera.imager_from_world.inverse() * hit->p_camera;
  hit->p_board = p_origin + distance * d;
  return true;
}

// d direction / d values of the camera for a fixed pixel (3 x n).
bool direction_by_values(const ImagerView& camera, const Vector3d& d, Eigen::Matrix3Xd* derivative) {
  const auto count = static_cast<Eigen::Index>(camera.values.size());
  Matrix23 by_d;
  Derivatives::Values by_values(2, count);
  Vector2d px;
  if (!camera.model.project(camera.values, d, &px, by_d.data(), by_values.data())) return false;
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = d.unitOrthogonal();
  across.col(1) = d.cross(across.col(0));
  const Eigen::Matrix2d inner = by_d * across;
  *derivative = -across * inner.inverse() * by_values;
  return derivative->allFinite();
}

}  // namespace

double BoardShape::z(const Vector2d& bend, double x, double y) const { return bend.dot(per_bend(x, y)); }

Vector2d BoardShape::slope(const Vector2d& bend, double x, double y) const {
  const double xr = 2 * x / width_m - 1, yr = 2 * y / height_m - 1;
  return {-4 * bend.x() * xr / width_m, -4 * bend.y() * yr / height_m};
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
  derivatives->bend =
      by_world * (world_from_board.rotation * Vector3d::UnitZ()) * shape.per_bend(x, y).transpose();
  return true;
}

bool meet_board(const ImagerView& camera,
                const Pose& world_from_board,
                const BoardShape& shape,
                const Vector2d& bend,
                const Vector2d& px_camera,
                Vector3d* p_world) {
  Hit hit;
  if (!cast(camera, world_from_board, shape, bend, px_camera, &hit)) return false;
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
  Hit hit;
  if (!cast(camera, world_from_board, shape, bend, px_camera, &hit)) return false;
  const Vector3d arm_projector = projector.imager_from_world.rotation * hit.p_world;
  const Vector3d p_projector = arm_projector + projector.imager_from_world.translation;
  if (!(p_projector.z() > 0)) return false;
  if (!derivatives) return projector.model.project(projector.values, p_projector, px_projector);

  Matrix23 by_p;
  derivatives->projector_values.resize(2, static_cast<Eigen::Index>(projector.values.size()));
  if (!projector.model.project(projector.values, p_projector, px_projector, by_p.data(),
                               derivatives->projector_values.data()))
    return false;
  Eigen::Matrix3Xd d_by_values;
  if (!direction_by_values(camera, hit.d_camera, &d_by_values)) return false;

  // The point stays on the sheet: n . (its movement relative to the board) = movement of the sheet along
  // z_board.
  const Matrix3d world_from_camera = camera.imager_from_world.rotation_matrix().transpose();
  const Vector2d slope = shape.slope(bend, hit.p_board.x(), hit.p_board.y());
  const Vector3d n_world = world_from_board.rotation * Vector3d(-slope.x(), -slope.y(), 1);
  const Vector3d d_world = world_from_camera * hit.d_camera;
  const double rate = n_world.dot(d_world);
  const Vector3d arm_board = hit.p_world - world_from_board.translation;
  const Vector3d arm_camera = hit.p_camera - camera.imager_from_world.translation;
  // A movement m of the ray's point that ignores the board becomes m - d (n.m)/(n.d).
  const Matrix3d along_sheet = Matrix3d::Identity() - d_world * n_world.transpose() / rate;
  const Matrix23 by_world = by_p * projector.imager_from_world.rotation_matrix();
  const Matrix23 by_free = by_world * along_sheet;

  derivatives->projector_pose = by_p * moved_by_pose(arm_projector);
  derivatives->camera_values = by_free * world_from_camera * hit.distance * d_by_values;
  derivatives->camera_pose = -by_free * world_from_camera * moved_by_pose(arm_camera);
  const Vector2d by_distance = by_world * d_world / rate;
  derivatives->board_pose = by_distance * (n_world.transpose() * moved_by_pose(arm_board));
  derivatives->bend = by_distance * shape.per_bend(hit.p_board.x(), hit.p_board.y()).transpose();
  return true;
}

}  // namespace limn::calib
