#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/config.h"
#include "core/pose.h"
#include "core/result.h"
#include "scene/meshes/material.h"

namespace limn::scene {

/// An image on a finish: a decal, or a pattern that repeats.
struct FinishImage {
  /// How the image lies on the prototype: it is projected along the z axis of its frame, whose origin is the
  /// image's middle; x right, y up.
  struct Projection {
    Pose prototype_from_image;
    Eigen::Vector2d size_m = {1, 1};  ///< Width and height of the image.
  };
  Texture texture;                       ///< 8-bit BGR, or BGRA whose alpha lets the finish's colour through.
  std::optional<Projection> projection;  ///< Absent: the image lies in the mesh's texture coordinates.
  bool repeats = false;                  ///< It is a pattern; else the finish's own colour is around it.
};

/// How the whole prototype looks in light: a coat of paint, which is drawn below the parts.
struct Finish {
  std::string name;
  Eigen::Vector3d base_colour = Eigen::Vector3d::Constant(0.8);  ///< Linear light, 0 … 1.
  double metallic = 0, roughness = 1;                            ///< As in glTF, 0 … 1.
  double clearcoat = 0, clearcoat_roughness = 0;                 ///< As in glTF, 0 … 1.
  /// It is shaded as the viewer sees it, so that reflections move with the viewer; else as seen along the
  /// prototype's normal, the same for everybody.
  bool for_viewer = false;
  std::optional<FinishImage> image;

  /// Purely diffuse, as Material with these values.
  bool is_diffuse() const { return metallic == 0 && roughness == 1; }
};

/// Reads an entry of `finishes` of a scene (config/README.md). The image is not read yet: `texture.file` is
/// its whole path. Problems are recorded at the node.
Finish read_finish(const ConfigNode& node);

/// Reads the finish's image. Error: no image, or, without a projection, a mesh without texture coordinates.
Status load_finish_image(bool mesh_has_uvs, Finish* finish);

}  // namespace limn::scene
