#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "projector/resources.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

/// Distances from a mesh's surface over a grid of k_nodes^3 nodes around it, in the mesh's frame.
struct DistanceField {
  static constexpr int k_nodes = 48;
  Eigen::Vector3f p_lower = Eigen::Vector3f::Zero(), p_upper = Eigen::Vector3f::Zero();  ///< of the nodes (m)
  std::vector<float> distances;  ///< m, from either side; x runs fastest; empty: a mesh without triangles
};

/// The grid reaches `farthest_m` beyond the mesh's bounds; distances beyond that are cut to it.
DistanceField distance_field(const scene::Mesh& mesh, double farthest_m);

/// The soft shadow of parts that stand on or just off the prototype (shaders/contact.glsl): how much of even
/// light from all sides they keep from a point, the nearer the more (obscurance: Zhukov et al. 1998, "An
/// ambient light illumination model"), by cones through each part's distance field (after Wright 2015,
/// "Dynamic occlusion with signed distance fields"). Parts of mode `surface` have none.
class ContactShadow final : public Bindable {
 public:
  /// Light that comes past a part counts the more the farther off the part is met, all of it at this length
  /// (m).
  static constexpr double k_free = 0.04;
  /// Radius a length of the cones: 30 degrees to each side, as six fill half a sphere.
  static constexpr double k_widening = 0.577;
  /// Farther than this (m) from every part there is no shadow.
  static constexpr double k_reach = (1 + k_widening) * k_free;

  explicit ContactShadow(const scene::Scene& scene);
  /// Sends which parts are shown to the GPU.
  void place(const scene::PosedScene& posed);
  /// Resource::contact_shadow.
  void bind(const Use& use) const override;

 private:
  struct GpuField {
    Eigen::Vector4f lower = Eigen::Vector4f::Zero();  // w: 1 when it is shown
    Eigen::Vector4f nodes_per_m = Eigen::Vector4f::Zero();
    Eigen::Vector4f first = Eigen::Vector4f::Zero();  // node in the texture
  };
  struct SlotFields {
    std::string name;
    std::map<std::string, GpuField> variants;
  };
  std::vector<SlotFields> slots_;
  std::vector<GpuField> shown_;  // by owner
  GlName distances_, fields_;
};

}  // namespace limn::projector
