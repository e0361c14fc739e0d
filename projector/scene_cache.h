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

bool is_same(const Pose& a, const Pose& b);
bool is_same(const scene::PosedScene& a, const scene::PosedScene& b);
/// Whether both have the same size and lens; their poses may differ.
bool is_same_lens(const Imager& a, const Imager& b);

/// The scene on the GPU as it was drawn last, with what projectors and one eye see of it: what did not change
/// is not drawn again.
class SceneCache {
 public:
  static Result<SceneCache> create(const scene::Scene& scene, const Rig& rig, PassTimes* times);

  /// What projectors have to see: their own images need all, others whether the prototype hides a place from
  /// them.
  enum class FromProjectors { nothing, prototype, all };
  /// Puts everything in its place and draws what projectors see of it.
  void prepare(const scene::PosedScene& posed, FromProjectors needed);
  /// Draws what an eye, or an imager, sees of what was prepared; `parts_alone`: only where parts may be.
  void draw_from_eye(const Imager& viewer);
  void draw_from_imager(const Imager& imager, bool parts_alone = false);
  /// Draws what the camera that measured the prototype sees of what was prepared, for good.
  void draw_from_reference_camera(const Imager& camera);

  /// Keeps those of the newest few imagers.
  const GpuLens& lens_of(const Imager& imager);
  const GpuLens& projector_lens(std::size_t index) const { return visibility_.projector_lens(index); }

  /// Scene, viewpoints, occlusion and lens of what was prepared; for a viewer also the room's light.
  Resources resources(const GpuLens& lens) const;
  Resources resources(const GpuLens& lens, const Imager& viewer);

  const GpuScene& scene() const { return scene_; }
  const VisibilityBuffers& visibility() const { return visibility_; }
  OcclusionMaps& occlusion() { return occlusion_; }
  const std::vector<PlacedRun>& runs() const { return runs_; }
  const Pose& scene_from_world() const { return scene_from_world_; }
  /// Never 0; another one once the prototype has moved or light arrives in another way.
  GLuint stamp() const { return prototype_moves_ + occlusion_.changes() + 1; }

 private:
  SceneCache(const scene::Scene& scene, const Rig& rig, VisibilityBuffers visibility, PassTimes* times);

  GpuScene scene_;
  VisibilityBuffers visibility_;
  OcclusionMaps occlusion_;
  RoomLighting room_lighting_;
  PassTimes* times_;
  std::optional<scene::PosedScene> prepared_;
  unsigned prototype_moves_ = 0;
  // What is drawn of it from the projectors.
  bool is_prototype_seen_ = false, are_soft_edges_seen_ = false, are_surface_parts_seen_ = false;
  std::vector<PlacedRun> runs_;
  Pose scene_from_world_;
  enum class EyeKind { none, imager, parts_of_imager, eye };
  EyeKind eye_kind_ = EyeKind::none;
  Imager eye_;
  std::vector<std::pair<Imager, GpuLens>> lenses_;  // of cameras and viewers, the newest last
};

}  // namespace limn::projector
