#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "core/imager.h"
#include "scene/room_image.h"
#include "scene/room_light.h"
#include "sim/texture.h"

namespace limn::sim {

/// A scene's picture of the room for sums over directions: each direction gets the mean light of the solid
/// angle that it stands for.
class RoomImageSizes {
 public:
  explicit RoomImageSizes(const scene::RoomImage& image);
  /// Linear BGR from a direction (world frame), over a solid angle (sr).
  Eigen::Vector3d from(const Eigen::Vector3d& d_world, double solid_angle) const;

 private:
  std::vector<scene::RoomImage> sizes_;  // each with a quarter of the pixels of the one before
};

/// The light by which parts are shaded (config/README.md, `light` of a scene). World frame.
struct PartsLight {
  scene::RoomLight room;
  std::shared_ptr<const RoomImageSizes> image_sizes = {};  ///< The room's picture; null: there is none.
  bool is_room_light = false;  ///< It is a room's light; else it moves with the viewer.

  /// The light that moves with a viewer: soft light around the viewer's up direction and a lamp above the
  /// left shoulder.
  static PartsLight beside(const Imager& viewer);
};

/// The colour of a surface seen from direction d_view, linear BGR; n is its unit normal on the viewer's side,
/// and n_coat that of its clear layer (absent: n). `image_sizes`: the picture of the room, null if there is
/// none. Uses the metallic-roughness material of glTF 2.0 (appendix B); the reflected soft light is a sum
/// over directions.
Eigen::Vector3d shaded(const SurfaceMaterial& material,
                       const Eigen::Vector3d& n,
                       const Eigen::Vector3d& d_view,
                       const scene::RoomLight& room,
                       const std::optional<Eigen::Vector3d>& n_coat = {},
                       const RoomImageSizes* image_sizes = nullptr);

}  // namespace limn::sim
