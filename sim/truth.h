#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/imager.h"
#include "scene/posed_scene.h"
#include "sim/ray_scene.h"
#include "sim/world.h"

namespace limn::sim {

/// Where a ray from an imager lands.
struct Landing {
  std::string object;
  Eigen::Vector3d p_world;
  Eigen::Vector3d p_object;  ///< In the object's own frame.
  Eigen::Vector3d n_world;   ///< Geometric normal, towards the imager.
};

/// A point of a surface, in its mesh's frame.
struct SampledPoint {
  Eigen::Vector3d p;
  Eigen::Vector3d n;  ///< Unit normal, interpolated.
};

/// The object that each pixel shows: `image` (CV_16S) holds indices into `names`, -1 for nothing.
struct ObjectImage {
  cv::Mat image;
  std::vector<std::string> names;
};

/// Ground truth by exact rays, for a world as it is when this object is made, with virtual parts at `parts`.
/// Queries about physical things ignore the parts. Borrows the world and its scene's meshes, which must
/// outlive it unchanged: make a new object after a move.
class Truth {
 public:
  explicit Truth(const World& world, const scene::PosedScene& parts = {});

  /// Where a projector's pixel lands, or what a camera's pixel sees; nullopt when nothing is there.
  std::optional<Landing> landing(const Imager& imager, const Eigen::Vector2d& px) const;

  /// Whether a point on a surface (within 0.1 mm) is inside the imager's image and not occluded.
  bool visible(const Imager& imager, const Eigen::Vector3d& p_world) const;

  /// The nearest object at every pixel's centre, among physical objects and parts ("part-SLOT").
  ObjectImage object_image(const Imager& imager) const;

  /// A part in the viewer's image: 255 where the ray behind the part meets the prototype at a point that a
  /// projector reaches, 128 where not, 0 where the part is not seen (the prototype hides it, or it is
  /// elsewhere). Only the prototype occludes and casts shadows; plates and stands count as its surface. A
  /// surface part (Mode::surface) is visible within 2 mm of the surface.
  cv::Mat part_mask(const Imager& viewer, const std::string& slot) const;

 private:
  struct Part {
    scene::PosedPart posed;
    const scene::Slot* slot = nullptr;
    const scene::Mesh* mesh = nullptr;
  };
  std::vector<Hit> hits(const RayScene& scene, const Imager& imager) const;
  bool is_reached_by_projector(const Eigen::Vector3d& p_world, const Eigen::Vector3d& n_world) const;
  const Part* find_part(const std::string& slot) const;

  const World& world_;
  std::vector<Part> parts_;
  RayScene physical_;
  RayScene prototype_;
};

/// At least `count` random points, uniform over the mesh's area; the same seed gives the same points.
std::vector<SampledPoint> surface_points(const scene::Mesh& mesh, int count, std::uint64_t seed);

/// The world with the parts added as physical objects: how the illuminated prototype should look.
World with_parts(const World& world, const scene::PosedScene& parts);

}  // namespace limn::sim
