#include "exchange/mpcdi.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "core/result.h"

namespace limn::exchange {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_degree = std::numbers::pi / 180;

// The edges of the frustum's image as tangents, x right, y down.
struct Edges {
  double left = 0, right = 0, top = 0, bottom = 0;
};

Edges edges_of(const MpcdiFrustum& frustum) {
  return {std::tan(frustum.left * k_degree), std::tan(frustum.right * k_degree),
          -std::tan(frustum.up * k_degree), -std::tan(frustum.down * k_degree)};
}

Matrix3d turn(double angle, const Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

// The columns are the frame's right, down and forward: the axes of an imager that is not turned.
Matrix3d axes_of(const MpcdiFrame& frame) {
  Matrix3d axes;
  axes << frame.d_right, frame.d_down, frame.d_forward;
  return axes;
}

Matrix3d rotation_of(const MpcdiFrustum& frustum) {
  return turn(frustum.yaw * k_degree, Vector3d::UnitY()) * turn(frustum.pitch * k_degree, Vector3d::UnitX()) *
         turn(frustum.roll * k_degree, Vector3d::UnitZ());
}

// Sets the three angles so that rotation_of() gives `r`.
void set_angles(const Matrix3d& r, MpcdiFrustum* frustum) {
  frustum->pitch = std::asin(std::clamp(-r(1, 2), -1.0, 1.0)) / k_degree;
  const bool is_upright = std::hypot(r(0, 2), r(2, 2)) < 1e-9;  // yaw and roll then turn about the same axis
  frustum->roll = is_upright ? 0 : std::atan2(r(1, 0), r(1, 1)) / k_degree;
  frustum->yaw = (is_upright ? std::atan2(-r(2, 0), r(0, 0)) : std::atan2(r(0, 2), r(2, 2))) / k_degree;
}

// The bounds of the tangents along the border of the imager's image.
Edges edges_of(const Imager& imager) {
  constexpr double k_most = std::numeric_limits<double>::max();
  Edges edges{k_most, -k_most, k_most, -k_most};
  const auto meet = [&](double x, double y) {
    const auto d = imager.lens.unproject(Vector2d(x, y));
    if (!d || d->z() <= 0) return;
    edges.left = std::min(edges.left, d->x() / d->z());
    edges.right = std::max(edges.right, d->x() / d->z());
    edges.top = std::min(edges.top, d->y() / d->z());
    edges.bottom = std::max(edges.bottom, d->y() / d->z());
  };
  for (int x = 0; x <= imager.width; ++x)
    for (const int y : {0, imager.height}) meet(x - 0.5, y - 0.5);
  for (int y = 0; y <= imager.height; ++y)
    for (const int x : {0, imager.width}) meet(x - 0.5, y - 0.5);
  LIMN_CHECK(edges.left < edges.right && edges.top < edges.bottom);
  return edges;
}

}  // namespace

void place_frustum(const Imager& imager, const MpcdiFrame& axes, MpcdiRegion* region) {
  const Pose world_from_imager = imager.imager_from_world.inverse();
  MpcdiFrustum frustum;
  set_angles(axes_of(axes).transpose() * world_from_imager.rotation_matrix(), &frustum);
  const Edges edges = edges_of(imager);
  frustum.left = std::atan(edges.left) / k_degree;
  frustum.right = std::atan(edges.right) / k_degree;
  frustum.up = -std::atan(edges.top) / k_degree;
  frustum.down = -std::atan(edges.bottom) / k_degree;
  region->frustum = frustum;
  region->frame = axes;
  region->frame->p_eye = world_from_imager.translation;
}

std::optional<Imager> imager_of(const MpcdiRegion& region) {
  if (!region.frustum || !region.frame || region.has_other_lens) return std::nullopt;
  const Edges edges = edges_of(*region.frustum);
  const double fx = region.width / (edges.right - edges.left),
               fy = region.height / (edges.bottom - edges.top);
  Imager imager{region.id, region.width, region.height, {}, Pose()};
  imager.lens = region.lens.value_or(Lens::pinhole(fx, fy, -0.5 - fx * edges.left, -0.5 - fy * edges.top));
  imager.imager_from_world =
      Pose(axes_of(*region.frame) * rotation_of(*region.frustum), region.frame->p_eye).inverse();
  return imager;
}

cv::Mat places_in_frustum(const MpcdiFrustum& frustum, const Imager& imager) {
  const Edges edges = edges_of(frustum);
  const std::vector<Eigen::Vector3f> directions = direction_map(imager.lens, imager.width, imager.height);
  cv::Mat places(imager.height, imager.width, CV_32FC3,
                 cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()));
  std::size_t i = 0;
  for (auto place = places.begin<cv::Vec3f>(); place != places.end<cv::Vec3f>(); ++place, ++i) {
    const Vector3d d = directions[i].cast<double>();
    if (!(d.z() > 0)) continue;
    *place = {static_cast<float>((d.x() / d.z() - edges.left) / (edges.right - edges.left)),
              static_cast<float>((d.y() / d.z() - edges.top) / (edges.bottom - edges.top)), 0.0f};
  }
  return places;
}

}  // namespace limn::exchange
