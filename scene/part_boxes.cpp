#include "scene/part_boxes.h"

namespace limn::scene {

PartBoxes::PartBoxes(const Scene& scene) {
  for (const Slot& slot : scene.slots)
    for (const Variant& variant : slot.variants) {
      Eigen::AlignedBox3d& box = boxes_[{slot.name, variant.name}];
      for (const Eigen::Vector3f& p : variant.mesh.positions) box.extend(p.cast<double>());
    }
}

const Eigen::AlignedBox3d* PartBoxes::find(const std::string& slot, const std::string& variant) const {
  const auto found = boxes_.find({slot, variant});
  return found == boxes_.end() ? nullptr : &found->second;
}

}  // namespace limn::scene
