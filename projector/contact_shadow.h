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
  /// Bounds of the nodes (m).
  Eigen::Vector3f p_lower = Eigen::Vector3f::Zero(), p_upper = Eigen::Vector3f::Zero();
  std::vector<float> distances;  ///< Unsigned distances (m); x runs fastest. Empty: a mesh without triangles.
};

/// The grid reaches `farthest_m` beyond the mesh's bounds; larger distances are clamped to it .
DistanceField distance_field(const scene::Mesh& mesh, double farthest_m);

/// The soft shadow of parts that stand on or just above the prototype (shaders/contact.glsl): how much of the
/// uniform light from all sides they keep from a point. Nearer parts count more (obscurance: Zhukov et al.
/// 1998, "An ambient light illumination model"). Computed by tracing cones through each part's distance field
/// (after Wright 2015, "Dynamic occlusion with signed distance fields"). Parts of mode `surface` have no
/// contact shadow.
class ContactShadow final : public Bindable {
 public:
  /// A part blocks less light the farther away it is; at this distance (m) it blocks none.
  static constexpr double k_free = 0.04;
  /// Radius of a cone divided by its length: tan of the half angle of 30 degrees, with which six cones fill a
  /// hemisphere.
  static constexpr double k_widening = 0.577;
  /// Largest distance (m) from a part at which there is a shadow.
  static constexpr double k_reach = (1 + k_widening) * k_free;

  explicit ContactShadow(const scene::Scene& scene);
  /// Uploads which parts are shown.
  void place(const scene::PosedScene& posed);
  /// Binds Resource::contact_shadow.
  void bind(const Use& use) const override;

 private:
  struct GpuField {
    Eigen::Vector4f lower = Eigen::Vector4f::Zero();  // w: 1 when the part is shown
    Eigen::Vector4f nodes_per_m = Eigen::Vector4f::Zero();
    Eigen::Vector4f first = Eigen::Vector4f::Zero();  // its first node in the texture
    Eigen::Vector4f cut = {0, 0, 0, -1};  // the plane that cuts it, as coefficients() in its frame
  };
  struct SlotFields {
    std::string name;
    std::map<std::string, GpuField> variants;
  };
  std::vector<SlotFields> slots_;
  std::optional<scene::Section> section_;
  std::vector<GpuField> shown_fields_;  // indexed by owner
  GlName distances_, fields_;
};

}  // namespace limn::projector
