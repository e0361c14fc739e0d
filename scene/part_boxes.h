#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <utility>

#include "scene/scene.h"

namespace limn::scene {

/// The bounding boxes of all variants of a scene's parts, in the parts' frames.
class PartBoxes {
 public:
  explicit PartBoxes(const Scene& scene);
  /// Null: there is no such part.
  const Eigen::AlignedBox3d* find(const std::string& slot, const std::string& variant) const;

 private:
  std::map<std::pair<std::string, std::string>, Eigen::AlignedBox3d> boxes_;
};

}  // namespace limn::scene
