#pragma once

#include <Eigen/Core>

#include "core/imager.h"
#include "scene/room_light.h"
#include "sim/texture.h"

namespace limn::sim {

/// The light that parts are shaded by (config/README.md, `light` of a scene). World frame.
struct PartsLight {
  scene::RoomLight room;
  bool is_known = false;  ///< it is a room's; else it stands with a viewer

  /// Soft light around the eye's up direction and a lamp above its left shoulder.
  static PartsLight beside(const Imager& eye);
};

/// What a surface of unit normal n, on the side of the eye, looks like from there, linear BGR: the
/// metallic-roughness material of glTF 2.0 (appendix B), the mirrored soft light as a sum over directions.
Eigen::Vector3d shaded(const SurfaceMaterial& substance,
                       const Eigen::Vector3d& n,
                       const Eigen::Vector3d& d_eye,
                       const scene::RoomLight& room);

}  // namespace limn::sim
