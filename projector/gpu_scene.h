#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "projector/resources.h"
#include "projector/surface_lines.h"
#include "projector/volume_stack.h"
#include "scene/deviation_layer.h"
#include "scene/posed_scene.h"

namespace limn::projector {

/// A range of triangles on the GPU (one mesh) and its bounds in the mesh's frame (m).
struct TriangleRun {
  /// Consecutive triangles of the mesh, which are culled together.
  struct Cluster {
    int first = 0;
    int count = 0;
    Eigen::AlignedBox3d box;
  };
  int first = 0;
  int count = 0;
  bool has_cut_outs = false;  ///< Whether a material uses an alpha cutoff.
  /// Whether it bounds a solid and its triangles wind as seen from outside, so that its front faces hide its
  /// back faces. (Unchecked: that it does not turn inside out where it cuts through itself.)
  bool is_solid = false;
  Eigen::Vector3d p_lower = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_upper = Eigen::Vector3d::Zero();
  std::vector<Cluster> clusters = {};  ///< Together they cover the whole run, in its order.
};

/// A mesh with its pose. Owner 0 is the prototype, owner i + 1 is slot i.
struct PlacedRun {
  int owner = 0;
  const TriangleRun* run = nullptr;
  Pose scene_from_owner;
  bool on_surface = false;  ///< Whether its slot's mode is `surface`.
  int finish = -1;          ///< Index in the scene of the prototype's finish; -1: none.
  unsigned lines = 0;       ///< Stamp of the lines on the prototype; 0: none (SurfaceLines::stamp).
  scene::MaterialOverride material = {};
  /// The plane that cuts it, in the scene's frame. The prototype is cut in views only.
  std::optional<scene::CutPlane> cut = {};
  scene::PaintedDeviation deviation =
      {};                     ///< What paints the prototype; its finish is then that of a deviation.
  StackedVolume volume = {};  ///< What its cap shows.
};

/// All meshes of a scene on the GPU, in the layout that shaders/scene.glsl reads.
class GpuScene final : public Bindable {
 public:
  /// Number of triangles that the driver's largest texel buffer holds.
  static std::size_t most_triangles();
  /// Error: more than `most` triangles.
  static Status check_fits(const scene::Scene& scene, std::size_t most);
  /// A texture that is larger than 4096 x 4096 texels, or than the driver's limit, is reduced to it, with a
  /// warning.
  explicit GpuScene(const scene::Scene& scene);

  /// Writes the meshes that a posed scene shows to `runs`. Their poses are in the coordinate frame "scene",
  /// in which rays are cast: the prototype's frame if it is placed, else the world.
  void placed(const scene::PosedScene& posed, std::vector<PlacedRun>* runs) const;
  /// Uploads the lines that a posed scene shows; before placed().
  void place_lines(const scene::PosedScene& posed) { lines_.place(posed); }
  static Pose scene_from_world(const scene::PosedScene& posed);
  /// Uploads the poses.
  void place(const std::vector<PlacedRun>& runs);
  /// Whether the prototype is cut, too, in what is drawn from now on. Off by default.
  void cut_prototype(bool wanted) { is_prototype_cut_ = wanted; }
  bool is_prototype_cut() const { return is_prototype_cut_; }
  /// Uploads the deviation from the CAD that posed scenes may show, instead of a former one. A layer for
  /// another mesh is not shown.
  void set_deviation(const scene::DeviationLayer& layer);
  /// Binds Resource::scene.
  void bind(const Use& use) const override;

  bool has_cut_outs() const { return has_cut_outs_; }
  /// Defines that the shading programs need for the scene's materials.
  Defines shading_defines() const {
    return (has_surface_maps_ ? Defines{Define::surface_maps} : Defines{}) +
           (has_clearcoat_ ? Defines{Define::clearcoat} : Defines{}) +
           (has_second_uvs_ ? Defines{Define::second_uvs} : Defines{}) +
           (has_vertex_colours_ ? Defines{Define::vertex_colours} : Defines{}) +
           (has_room_image_ ? Defines{Define::room_image} : Defines{}) + section_defines();
  }
  /// Define::section in a scene with a section, Define::volumes where it also has volumes.
  Defines section_defines() const {
    return (section_ ? Defines{Define::section} : Defines{}) +
           (volumes_.is_empty() ? Defines{} : Defines{Define::volumes});
  }
  /// The same for a prototype with a finish or lines.
  Defines finish_defines() const {
    return shading_defines() + Defines{Define::finish} +
           (has_coated_finish_ ? Defines{Define::clearcoat} : Defines{});
  }
  GLuint vertex_array() const { return *vertex_array_; }
  int owner_count() const { return static_cast<int>(slots_.size()) + 1; }

 private:
  struct SlotRuns {
    std::string name;
    bool on_surface = false;
    std::map<std::string, TriangleRun> variants;
  };
  struct Staging;
  struct GpuOwner {
    Eigen::Matrix4f owner_from_scene = Eigen::Matrix4f::Identity();
    Eigen::Vector4f lower = Eigen::Vector4f::Zero();  // w: 1 when the part is shown
    Eigen::Vector4f upper = Eigen::Vector4f::Zero();  // w: 1 when its mode is surface
    Eigen::Vector4f colour = Eigen::Vector4f::Zero();
    // The prototype's has also z: its finish's material + 1, or 0; w: 1 when the finish is for the viewer.
    Eigen::Vector4f metallic_roughness = {-1, -1, 0, 0};
    Eigen::Vector4f hatch = Eigen::Vector4f::Zero();  // 0: not cut
  };
  Eigen::Vector4f hatch_of(const PlacedRun& placed) const;
  TriangleRun add(const scene::Mesh& mesh, int owner, Staging* staging);
  void add_finish(const scene::Finish& finish, Staging* staging);
  void add_material(const scene::Material& material, const scene::Mesh& mesh, Staging* staging);
  void add_second_uvs(const scene::Mesh& mesh, std::size_t first_material, Staging* staging);
  void add_tangents(const scene::Mesh& mesh, std::size_t first_material, Staging* staging);
  void add_colours(const scene::Mesh& mesh, std::size_t first_material, Staging* staging);

  std::optional<TriangleRun> prototype_;
  std::vector<SlotRuns> slots_;
  struct GpuFinish {
    std::string name;
    int material = 0;  // index in the materials
    bool for_viewer = false;
  };
  std::vector<GpuFinish> finishes_;  // the last one paints the deviation
  int deviation_ = 0;                // number of the layer that was uploaded; 0: none
  bool has_cut_outs_ = false, has_surface_maps_ = false, has_clearcoat_ = false, has_second_uvs_ = false,
       has_coated_finish_ = false, has_vertex_colours_ = false, has_room_image_ = false;
  std::optional<scene::Section> section_;
  std::optional<scene::CutPlane> cut_;  // cuts the runs that were placed last
  bool is_prototype_cut_ = false;
  VolumeStack volumes_;
  std::vector<GpuOwner> gpu_owners_;
  SurfaceLines lines_;
  GlName corners_, normals_, triangles_, materials_, placements_, vertex_array_;
  GlName corner_texels_, normal_texels_, triangle_texels_, placement_texels_;  // texel views of the buffers
  GlName colour_maps_, maps_, brdf_lut_, deviation_words_;
};

/// The corners of a mesh's bounds, with a margin, in the scene's frame.
std::array<Eigen::Vector3d, 8> bounds_of(const PlacedRun& placed, double margin_m = 0);

}  // namespace limn::projector
