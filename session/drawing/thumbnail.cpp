#include "session/drawing/thumbnail.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/names.h"

namespace limn::session {
namespace {

// Half the view angle; the projection is nearly parallel.
constexpr double k_half_angle = 15 * std::numbers::pi / 180;
constexpr double k_margin = 1.06;
const cv::Scalar k_ground(34, 29, 27);

}  // namespace

cv::Mat draw_thumbnail(projector::Renderer* renderer,
                       const scene::Scene& scene,
                       const std::string& slot,
                       const std::string& variant,
                       int side_px) {
  const scene::Slot* of = scene.find_slot(slot);
  if (!of) return {};
  const scene::Variant* shown = find_named(of->variants, variant);
  if (!shown) return {};
  // The world is the marker's frame: x right, y down, z into the surface it lies on.
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : shown->mesh.positions) box.extend(of->marker_from_part * p.cast<double>());
  const Eigen::Vector3d p_middle = box.center();
  double radius = 1e-4;
  for (const Eigen::Vector3f& p : shown->mesh.positions)
    radius = std::max(radius, (of->marker_from_part * p.cast<double>() - p_middle).norm());

  const Eigen::Vector3d d_ahead = Eigen::Vector3d(-0.45, 0.4, 1).normalized();
  const Eigen::Vector3d d_right = Eigen::Vector3d(0, 1, 0).cross(d_ahead).normalized();
  Eigen::Matrix3d imager_axes;  // rows: right, down, ahead
  imager_axes << d_right.transpose(), d_ahead.cross(d_right).transpose(), d_ahead.transpose();
  const Eigen::Vector3d p_eye = p_middle - k_margin * radius / std::sin(k_half_angle) * d_ahead;

  Imager imager;
  imager.name = "part";
  imager.width = imager.height = side_px;
  const double focal = 0.5 * side_px / std::tan(k_half_angle), middle = 0.5 * (side_px - 1);
  imager.lens = Lens::pinhole(focal, focal, middle, middle);
  imager.imager_from_world.rotation = Eigen::Quaterniond(imager_axes);
  imager.imager_from_world.translation = -(imager_axes * p_eye);
  return renderer->view(imager, {std::nullopt, {{slot, variant, of->marker_from_part}}, {}}, k_ground);
}

}  // namespace limn::session
