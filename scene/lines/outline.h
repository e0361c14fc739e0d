#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/pose.h"
#include "scene/lines/drape.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

/// The outline of a mesh as seen along the z axis of its frame.
struct Outline {
  std::vector<std::vector<Eigen::Vector2d>> rings;  ///< Closed curves (x, y), m; holes have them, too.
  double z_top = 0;  ///< z of the mesh's end that is farther from its plane z = 0: the side that it is on.
};

/// It is taken from an image of the mesh whose pixels are a 2000th of its longer side.
Outline outline_of(const Mesh& mesh);

/// The outline laid on the prototype along the part's z axis, on the side where the part is: on the first
/// surface below the part's top, at most 0.1 m below its plane z = 0. Pieces beside the prototype are left
/// out.
std::vector<SurfaceCurve> laid_outline(const Drape& prototype,
                                       const Outline& outline,
                                       const Pose& prototype_from_part);

/// The outlines of a scene's parts as they were laid last. Laying one takes some milliseconds, so that it is
/// done only when its part has moved by more than the tracker's jitter. Several threads may use it at once.
class Outlines {
 public:
  explicit Outlines(std::shared_ptr<const Drape> prototype) : prototype_(std::move(prototype)) {}

  /// The outline of a part. `name` says which slot and variant it is; `mesh` is always the same for a name.
  std::vector<SurfaceCurve> of(const std::string& name,
                               const Mesh& mesh,
                               const Pose& prototype_from_part) const;

 private:
  struct Laid {
    Outline outline;
    std::optional<Pose> prototype_from_part;
    std::vector<SurfaceCurve> curves;
  };
  std::shared_ptr<const Drape> prototype_;
  mutable std::mutex mutex_;
  mutable std::map<std::string, Laid> laid_;
};

}  // namespace limn::scene
