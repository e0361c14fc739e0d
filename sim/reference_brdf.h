#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/imager.h"
#include "scene/room_light.h"
#include "sim/texture.h"

namespace limn::sim {

/// The light by which parts are shaded (config/README.md, `light` of a scene). World frame.
struct PartsLight {
  scene::RoomLight room;
  bool is_room_light = false;  ///< It is a room's light; else it moves with the viewer.

  /// The light that moves with a viewer: soft light around the viewer's up direction and a lamp above the
  /// left shoulder.
  static PartsLight beside(const Imager& viewer);
};

/// The colour of a surface seen from direction d_view, linear BGR; n is its unit normal on the viewer's side,
/// and n_coat that of its clear layer (absent: n). Uses the metallic-roughness material of glTF 2.0 (appendix
/// B); the reflected soft light is a sum over directions.
Eigen::Vector3d shaded(const SurfaceMaterial& material,
                       const Eigen::Vector3d& n,
                       const Eigen::Vector3d& d_view,
                       const scene::RoomLight& room,
                       const std::optional<Eigen::Vector3d>& n_coat = {});

}  // namespace limn::sim
