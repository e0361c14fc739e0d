#include "calib/judge/error_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_side = 5;  // points along each side of the target

// Range of depths along camera 0's axis that the boards cover, with a margin.
std::pair<double, double> depth_range(const Observations& observations,
                                      const Solution& solution,
                                      double beyond) {
  const Board& board = observations.board;
  const Pose& camera_from_world = solution.rig.cameras.front().imager_from_world;
  double near = std::numeric_limits<double>::infinity(), far = -near;
  for (const auto& world_from_board : solution.world_from_board) {
    if (!world_from_board) continue;
    for (const Vector2d& corner :
         {Vector2d(0, 0), Vector2d(board.width_m(), 0), Vector2d(0, board.height_m()),
          Vector2d(board.width_m(), board.height_m())}) {
      const double depth =
          (camera_from_world * (*world_from_board * Vector3d(corner.x(), corner.y(), 0))).z();
      near = std::min(near, depth);
      far = std::max(far, depth);
    }
  }
  return {std::max(near - beyond, near / 2), far + beyond};
}

// A board-sized target around a point, facing the camera.
RigidTarget facing(const Imager& camera, const Board& board, const Vector3d& p_camera) {
  const Pose world_from_camera = camera.imager_from_world.inverse();
  RigidTarget thing;
  for (int i = 0; i < k_side * k_side; ++i) {
    const Vector3d offset(board.width_m() * ((i % k_side + 0.5) / k_side - 0.5),
                          board.height_m() * ((i / k_side + 0.5) / k_side - 0.5), 0);
    thing.push_back(world_from_camera * (p_camera + offset));
  }
  return thing;
}

double p95_at(const Observations& observations,
              const Solution& solution,
              const Uncertainty& uncertainty,
              size_t projector,
              const Vector3d& p_camera) {
  const Imager& camera = solution.rig.cameras.front();
  const Pose world_from_camera = camera.imager_from_world.inverse();
  const SurfaceTarget place{world_from_camera * p_camera, world_from_camera.rotation * Vector3d::UnitZ()};
  const auto covariance = light_covariances(
      solution, uncertainty, facing(camera, observations.board, p_camera), projector, {&place, 1});
  if (!covariance[0]) return std::numeric_limits<double>::quiet_NaN();
  const std::vector<Eigen::Matrix2d> only = {*covariance[0]};
  return 1e3 * p95_of({&only, 1});
}

Vector2d pinhole_place(const Imager& camera, const Vector3d& p_camera) {
  const Vector2d px(camera.lens.fx() * p_camera.x() / p_camera.z() + camera.lens.cx(),
                    camera.lens.fy() * p_camera.y() / p_camera.z() + camera.lens.cy());
  return (px + Vector2d(0.5, 0.5)).cwiseQuotient(Vector2d(camera.width, camera.height));
}

// Extends the map over the boards' middles, where they lie beyond camera 0's image.
void extend(const Observations& observations, const Solution& solution, ErrorMap* map) {
  constexpr double k_beyond = 0.02;  // share of the image: what the lens's distortion moves
  constexpr double k_most = 4;       // images in each direction; farther, boards stand at camera 0's side
  const Imager& camera = solution.rig.cameras.front();
  const Board& board = observations.board;
  Vector2d low(0, 0), high(1, 1);
  for (const auto& world_from_board : solution.world_from_board) {
    if (!world_from_board) continue;
    const Vector3d middle(board.width_m() / 2, board.height_m() / 2, 0);
    const Vector3d p_camera = camera.imager_from_world * (*world_from_board * middle);
    if (!(p_camera.z() > 0)) continue;
    const Vector2d place = pinhole_place(camera, p_camera);
    const Vector2d half = Vector2d(board.width_m() / 2 * camera.lens.fx() / camera.width,
                                   board.height_m() / 2 * camera.lens.fy() / camera.height) /
                          p_camera.z();
    for (const int axis : {0, 1}) {
      if (place[axis] < -k_beyond) low[axis] = std::min(low[axis], place[axis] - half[axis]);
      if (place[axis] > 1 + k_beyond) high[axis] = std::max(high[axis], place[axis] + half[axis]);
    }
  }
  map->low = low.cwiseMax(-k_most);
  map->high = high.cwiseMin(1 + k_most);
}

}  // namespace

double ErrorMap::worst_mm() const {
  double worst = 0;
  for (const Plane& plane : planes) {
    for (const double mm : plane.p95_mm) worst = std::isfinite(mm) ? std::max(worst, mm) : worst;
  }
  return worst;
}

Vector2d ErrorMap::place_of_cell(int cell) const {
  const Vector2d share((cell % columns + 0.5) / columns, (cell / columns + 0.5) / rows);
  return low + (high - low).cwiseProduct(share);
}

std::optional<Vector2d> ErrorMap::place_of(const Imager& camera, const Vector3d& p_camera) const {
  if (!(p_camera.z() > 0)) return std::nullopt;
  Vector2d place;
  if (is_wider_than_image()) {
    place = pinhole_place(camera, p_camera);
  } else {
    const auto px = camera.lens.project(p_camera);
    if (!px) return std::nullopt;
    place = {(px->x() + 0.5) / camera.width, (px->y() + 0.5) / camera.height};
  }
  const bool is_on_map = (place.array() >= low.array()).all() && (place.array() <= high.array()).all();
  return is_on_map ? std::optional(place) : std::nullopt;
}

std::optional<Vector3d> ErrorMap::point_at(const Imager& camera,
                                           const Vector2d& place,
                                           double depth_m) const {
  const Vector2d px(place.x() * camera.width - 0.5, place.y() * camera.height - 0.5);
  if (is_wider_than_image())
    return depth_m * Vector3d((px.x() - camera.lens.cx()) / camera.lens.fx(),
                              (px.y() - camera.lens.cy()) / camera.lens.fy(), 1);
  const auto d = camera.lens.unproject(px);
  if (!d || !(d->z() > 0)) return std::nullopt;
  return *d * (depth_m / d->z());
}

Vector2d ErrorMap::size_m(const Imager& camera, const Plane& plane) const {
  return plane.depth_m *
         (high - low)
             .cwiseProduct(Vector2d(camera.width / camera.lens.fx(), camera.height / camera.lens.fy()));
}

double ErrorMap::at(const Eigen::Vector2d& place, double depth_m) const {
  const Vector2d share = (place - low).cwiseQuotient(high - low);
  const double x = std::clamp(share.x() * columns - 0.5, 0.0, columns - 1.0),
               y = std::clamp(share.y() * rows - 0.5, 0.0, rows - 1.0);
  std::size_t plane = 0;
  while (plane + 2 < planes.size() && planes[plane + 1].depth_m < depth_m) ++plane;
  const std::size_t next = std::min(plane + 1, planes.size() - 1);
  const double apart_m = planes[next].depth_m - planes[plane].depth_m;
  const double z = apart_m > 0 ? std::clamp((depth_m - planes[plane].depth_m) / apart_m, 0.0, 1.0) : 0;
  double sum = 0, weights = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int column = std::min(static_cast<int>(x) + (corner & 1), columns - 1),
              row = std::min(static_cast<int>(y) + (corner >> 1 & 1), rows - 1);
    const double dx = x - std::floor(x), dy = y - std::floor(y);
    const double weight = (corner & 1 ? dx : 1 - dx) * (corner & 2 ? dy : 1 - dy) * (corner & 4 ? z : 1 - z);
    const double mm =
        planes[corner & 4 ? next : plane].p95_mm[static_cast<std::size_t>(row * columns + column)];
    if (!std::isfinite(mm)) continue;
    sum += weight * mm;
    weights += weight;
  }
  return weights > 0 ? sum / weights : std::numeric_limits<double>::quiet_NaN();
}

std::vector<ErrorMap> error_maps(const Observations& observations,
                                 const Solution& solution,
                                 const Uncertainty& uncertainty,
                                 const ErrorMapOptions& options) {
  const Imager& camera = solution.rig.cameras.front();
  const auto [near, far] = depth_range(observations, solution, options.beyond);
  std::vector<ErrorMap> maps;
  for (size_t projector = 0; projector < solution.rig.projectors.size(); ++projector) {
    ErrorMap map;
    map.projector = static_cast<int>(projector);
    if (solution.rig.cameras.size() > 1) extend(observations, solution, &map);
    const Vector2d extent = map.high - map.low;
    map.columns = static_cast<int>(std::lround(options.columns * extent.x()));
    map.rows = std::max(
        1, static_cast<int>(std::lround(options.columns * camera.height / camera.width * extent.y())));
    for (int i = 0; i < options.planes; ++i) {
      ErrorMap::Plane plane;
      plane.depth_m = options.planes > 1 ? near + (far - near) * i / (options.planes - 1) : (near + far) / 2;
      for (int cell = 0; cell < map.columns * map.rows; ++cell) {
        const auto p_camera = map.point_at(camera, map.place_of_cell(cell), plane.depth_m);
        plane.p95_mm.push_back(p_camera ? p95_at(observations, solution, uncertainty, projector, *p_camera)
                                        : std::numeric_limits<double>::quiet_NaN());
      }
      map.planes.push_back(std::move(plane));
    }
    maps.push_back(std::move(map));
  }
  return maps;
}

}  // namespace limn::calib
