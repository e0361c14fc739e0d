#include "scene/room_image.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "scene/files/hdr_image.h"

namespace limn::scene {

Eigen::Vector3f light_at(const cv::Mat& light, double u, double v) {
  const double x = u * light.cols - 0.5, y = std::clamp(v * light.rows - 0.5, 0.0, light.rows - 1.0);
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(y);
  const auto column = [&](int at) { return (at % light.cols + light.cols) % light.cols; };
  const auto texel = [&](int row, int at) {
    return Eigen::Map<const Eigen::Vector3f>(light.ptr<float>(std::min(row, light.rows - 1)) +
                                             3L * column(at));
  };
  const auto fx = static_cast<float>(x - left), fy = static_cast<float>(y - top);
  return (1 - fy) * ((1 - fx) * texel(top, left) + fx * texel(top, left + 1)) +
         fy * ((1 - fx) * texel(top + 1, left) + fx * texel(top + 1, left + 1));
}

Eigen::Vector3f RoomImage::from(const Eigen::Vector3d& d_world) const {
  const Eigen::Vector3d d = image_from_world * d_world;
  return light_at(light, 0.5 + std::atan2(d.x(), d.z()) / (2 * std::numbers::pi),
                  std::acos(std::clamp(d.y(), -1.0, 1.0)) / std::numbers::pi);
}

RoomImage read_room_image(const ConfigNode& node, const Eigen::Vector3d& d_up_world) {
  node.only({"file", "towards_world"});
  RoomImage image;
  image.file = node.at("file").path_inside();
  const ConfigNode towards = node.at("towards_world");
  const Eigen::Vector3d d = towards.vector3(), d_level = d - d.dot(d_up_world) * d_up_world;
  if (!(d_level.norm() > 1e-6 * d.norm())) {
    towards.problem("expected the direction in which the middle of the image lies, not straight up or down.");
    return image;
  }
  const Eigen::Vector3d d_ahead = d_level.normalized();
  image.image_from_world << d_ahead.cross(d_up_world).transpose(), d_up_world.transpose(),
      d_ahead.transpose();
  return image;
}

Status load_room_image(RoomImage* image) {
  LIMN_TRY(image->light, read_hdr_image(image->file));
  if (image->light.cols == 2 * image->light.rows) return {};
  return error("{}: expected an equirectangular image, twice as wide as high, found {} x {} pixels.",
               image->file.string(), image->light.cols, image->light.rows);
}

}  // namespace limn::scene
