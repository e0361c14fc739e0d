#include "sim/view_tiles.h"

#include <algorithm>
#include <cmath>

namespace limn::sim {
namespace {

float angle_between(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// Whether a line from a point of `light` to a point of `surfaces` can pass through the object.
bool is_shaded(const Ball& light, const Ball& surfaces, const Ball& object) {
  const Eigen::Vector3f along = surfaces.centre - light.centre, to_object = object.centre - light.centre;
  const float length2 = along.squaredNorm();
  if (!(length2 > 0)) return true;
  const float t = to_object.dot(along) / length2;
  // The lines lie within a cone from one ball to the other. Where the object is, it is this wide at most.
  const float slack = (object.radius + std::max(light.radius, surfaces.radius)) / std::sqrt(length2);
  const auto width_at = [&](float at) {
    return light.radius + std::clamp(at, 0.0F, 1.0F) * (surfaces.radius - light.radius);
  };
  const float reach = object.radius + std::max(width_at(t - slack), width_at(t + slack));
  return (to_object - std::clamp(t, 0.0F, 1.0F) * along).squaredNorm() <= reach * reach;
}

}  // namespace

ViewTiles::ViewTiles(cv::Size image, const Eigen::Vector3d& p_camera, const Directions& directions)
    : image_(image),
      columns_((image.width + k_side - 1) / k_side),
      rows_((image.height + k_side - 1) / k_side),
      p_camera_(p_camera.cast<float>()),
      tiles_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    const cv::Rect r = pixels(i);
    Tile& tile = tiles_[i];
    tile.d = directions.at(r.x + 0.5 * (r.width - 1), r.y + 0.5 * (r.height - 1));
    float widest = 0;
    bool is_known = tile.d.allFinite();
    for (const double x : {r.x - 0.5, r.x + r.width - 0.5})
      for (const double y : {r.y - 0.5, r.y + r.height - 0.5}) {
        const Eigen::Vector3f d = directions.at(x, y);
        is_known &= d.allFinite();
        if (is_known) widest = std::max(widest, angle_between(tile.d, d));
      }
    constexpr float k_bent = 1.1F;  // the edges between the corners may be bent by the lens
    if (is_known) tile.half_angle = k_bent * widest;
  }
}

cv::Rect ViewTiles::pixels(std::size_t tile) const {
  const auto i = static_cast<int>(tile);
  return cv::Rect(i % columns_ * k_side, i / columns_ * k_side, k_side, k_side) & cv::Rect({0, 0}, image_);
}

// Where a near and a far surface meet, one ball around both would be large.
void ViewTiles::set_surfaces(Tile* tile, std::span<const Eigen::Vector3f> p_world) const {
  float nearest = INFINITY, farthest = 0;
  const auto distance2 = [&](const Eigen::Vector3f& p) { return (p - p_camera_).squaredNorm(); };
  for (const Eigen::Vector3f& p : p_world) {
    nearest = std::min(nearest, distance2(p));
    farthest = std::max(farthest, distance2(p));
  }
  std::array<Eigen::AlignedBox3f, 2> boxes;
  for (const Eigen::Vector3f& p : p_world)
    boxes[distance2(p) > 0.5F * (nearest + farthest) ? 1 : 0].extend(p);
  for (std::size_t k = 0; k < boxes.size(); ++k)
    tile->surfaces[k] =
        boxes[k].isEmpty() ? Ball() : Ball{boxes[k].center(), 0.5F * boxes[k].diagonal().norm()};
}

bool ViewTiles::is_seen_through(const Tile& tile, const Ball& object) const {
  const Eigen::Vector3f towards = object.centre - p_camera_;
  const float distance = towards.norm();
  if (distance <= object.radius || !(tile.half_angle < 4)) return true;
  return angle_between(tile.d, towards) <= tile.half_angle + std::asin(object.radius / distance);
}

std::vector<std::uint8_t> ViewTiles::affected(std::span<const Ball> objects,
                                              std::span<const Ball> lights) const {
  std::vector<std::uint8_t> out(tiles_.size());
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    const Tile& tile = tiles_[i];
    out[i] = std::any_of(objects.begin(), objects.end(), [&](const Ball& object) {
      if (object.radius < 0) return false;
      const auto is_in_shadow = [&](const Ball& surfaces) {
        return surfaces.radius >= 0 && std::any_of(lights.begin(), lights.end(), [&](const Ball& light) {
                 return is_shaded(light, surfaces, object);
               });
      };
      return is_seen_through(tile, object) ||
             std::any_of(tile.surfaces.begin(), tile.surfaces.end(), is_in_shadow);
    });
  }
  return out;
}

std::vector<std::uint8_t> ViewTiles::with_neighbours(std::span<const std::uint8_t> marked) const {
  std::vector<std::uint8_t> out(marked.size());
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column)
      for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r)
        for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c)
          out[static_cast<std::size_t>(row * columns_ + column)] |=
              marked[static_cast<std::size_t>(r * columns_ + c)];
  return out;
}

}  // namespace limn::sim
