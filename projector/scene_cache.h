#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "core/rig.h"
#include "projector/gpu_scene.h"
#include "projector/occlusion_maps.h"
#include "projector/pass_times.h"
#include "projector/room_lighting.h"
#include "projector/visibility_buffers.h"
#include "scene/posed_scene.h"
#include "scene/scene.h"

namespace limn::projector {

using limn::is_same;
using scene::is_same;
using scene::is_same_prototype;
using scene::is_same_without_lines;
bool is_same(const PlacedRun& a, const PlacedRun& b);
/// Whether both have the same size and lens; their poses may differ.
bool is_same_lens(const Imager& a, const Imager& b);

/// The scene on the GPU as it was drawn last, with the visibility buffers of the projectors and of one
/// viewpoint. What did not change is not drawn again.
class SceneCache {
 public:
  static Result<SceneCache> create(const scene::Scene& scene, const Rig& rig, PassTimes* times);

  /// Which ids are needed from the projectors. Their own images need all; composites only need to know where
  /// the prototype hides a point from a projector.
  enum class FromProjectors { nothing, prototype, all };
  /// Sets all poses and draws the projectors' ids.
  void prepare(const scene::PosedScene& posed, FromProjectors needed);
  /// Draws the ids that a viewer or an imager sees of the prepared scene.
  void draw_from_viewer(const Imager& viewer);
  void draw_from_imager(const Imager& imager);
  /// The same only where the imager sees something within `around_m` of the meshes `over`. `cuts_prototype`:
  /// a plane that cuts the prototype is used, until the next prepare().
  void draw_from_imager_over(const Imager& imager,
                             const std::vector<PlacedRun>& over,
                             double around_m,
                             bool cuts_prototype);
  /// Draws the ids that the reference camera sees of the prepared scene, and keeps them.
  void draw_from_reference_camera(const Imager& camera);

  /// The imager's lens on the GPU. The lenses of the last few imagers are kept.
  const GpuLens& lens_of(const Imager& imager);
  const GpuLens& projector_lens(std::size_t index) const { return visibility_.projector_lens(index); }

  /// Scene, viewpoints, occlusion and lens of the prepared scene; with a viewer also the room light.
  Resources resources(const GpuLens& lens) const;
  Resources resources(const GpuLens& lens, const Imager& viewer);

  const GpuScene& scene() const { return scene_; }
  const VisibilityBuffers& visibility() const { return visibility_; }
  OcclusionMaps& occlusion() { return occlusion_; }
  const std::vector<PlacedRun>& runs() const { return runs_; }
  /// GpuScene::set_deviation.
  void set_deviation(const scene::DeviationLayer& layer);
  /// Whether the prepared scene's prototype has a finish or lines, or shows its deviation.
  bool is_painted() const;
  const Pose& scene_from_world() const { return scene_from_world_; }
  /// Version number for caches: never 0, and different after the prototype has moved or the occlusion has
  /// changed.
  GLuint stamp() const { return prototype_moves_ + occlusion_.changes() + 1; }

 private:
  enum class ViewpointKind { none, imager, places_of_imager, viewer };
  SceneCache(const scene::Scene& scene, const Rig& rig, VisibilityBuffers visibility, PassTimes* times);
  bool is_drawn_from(ViewpointKind kind, const Imager& imager) const;

  GpuScene scene_;
  VisibilityBuffers visibility_;
  OcclusionMaps occlusion_;
  RoomLighting room_lighting_;
  PassTimes* times_;
  std::optional<scene::PosedScene> prepared_;
  unsigned prototype_moves_ = 0;
  // Which of the projectors' ids are drawn for `prepared_`.
  bool is_prototype_drawn_ = false, are_soft_edges_drawn_ = false, are_surface_parts_drawn_ = false;
  std::vector<PlacedRun> runs_;
  Pose scene_from_world_;
  ViewpointKind viewpoint_kind_ = ViewpointKind::none;
  Imager viewpoint_imager_;
  std::vector<PlacedRun> viewpoint_over_;  // with places_of_imager: the arguments of draw_from_imager_over
  double viewpoint_around_m_ = 0;
  bool viewpoint_cuts_prototype_ = false;
  std::vector<std::pair<Imager, GpuLens>> lenses_;  // lenses of cameras and viewers, the newest last
};

}  // namespace limn::projector
