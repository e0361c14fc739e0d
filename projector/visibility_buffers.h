#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <vector>

#include "core/rig.h"
#include "projector/bake.h"
#include "projector/cap_counter.h"
#include "projector/edge_feathering.h"
#include "projector/gpu_scene.h"
#include "projector/pinhole_view.h"
#include "projector/resources.h"

namespace limn::projector {

/// An imager's lens on the GPU: the rays of its pixels.
struct GpuLens final : public Bindable {
  BakedLens baked;
  GlName tangents;

  explicit GpuLens(const Imager& imager);
  /// Binds Resource::lens.
  void bind(const Use& use) const override;
};

/// Images of triangle ids (shaders/ids.frag) from all projectors and from one viewer or camera, with the
/// poses of these viewpoints, as shaders/scene.glsl reads them. Layer 2 i of the projectors' ids is the
/// prototype, layer 2 i + 1 the surface parts; layer 0 of the viewer's ids is the prototype, layer 1 the
/// parts. The layer after the projectors' is for the reference camera, which measured the prototype and keeps
/// its pose in the scene's frame.
class VisibilityBuffers final : public Bindable {
 public:
  /// `has_section`: planes may cut what is drawn; what they need is made ready.
  static Result<VisibilityBuffers> create(const Rig& rig, bool has_section);

  /// Draws the projectors' ids of the prototype. `with_soft_edges`: also computes the edge feathering, which
  /// only the projectors' own images need.
  void draw_prototype_from_projectors(const GpuScene& scene,
                                      const std::vector<PlacedRun>& runs,
                                      const Pose& scene_from_world,
                                      bool with_soft_edges);
  /// Draws the projectors' ids of the surface parts. The prototype's ids must have been drawn for the same
  /// pose.
  void draw_surface_parts_from_projectors(const GpuScene& scene,
                                          const std::vector<PlacedRun>& runs,
                                          const Pose& scene_from_world);
  /// Draws the ids from an imager's own position, over its image.
  void draw_from_imager(const GpuScene& scene,
                        const std::vector<PlacedRun>& runs,
                        const Pose& scene_from_world,
                        const Imager& imager,
                        const BakedLens& lens);
  /// The same only for the pixels that see something within `around_m` of the meshes `over`, and for some
  /// pixels around these.
  void draw_from_imager_over(const GpuScene& scene,
                             const std::vector<PlacedRun>& runs,
                             const Pose& scene_from_world,
                             const Imager& imager,
                             const BakedLens& lens,
                             const std::vector<PlacedRun>& over,
                             double around_m);
  /// Draws the ids from a viewer's position, over its view parts, at the resolution at which the projectors
  /// show them. `d_up_scene` is any direction that is not parallel to the viewing direction.
  void draw_from_viewer(const GpuScene& scene,
                        const std::vector<PlacedRun>& runs,
                        const Pose& scene_from_world,
                        const Eigen::Vector3d& p_viewer_scene,
                        const Eigen::Vector3d& d_up_scene);

  /// Rectangles of the projector's image, outside of which it gives no light for the parts. There is one for
  /// each part: where the viewer sees the prototype behind it, or where it lies on the surface.
  void light_rects(std::size_t projector,
                   const std::vector<PlacedRun>& runs,
                   const Pose& scene_from_world,
                   const Eigen::Vector3d& p_viewer_scene,
                   std::vector<cv::Rect>* of_view,
                   std::vector<cv::Rect>* of_surface) const;
  /// Rectangles of an imager's image, outside of which it sees no part, nor anything within `around_m` of
  /// one. `prototype_too` adds the prototype.
  std::vector<cv::Rect> visible_rects(const Imager& imager,
                                      const BakedLens& lens,
                                      const std::vector<PlacedRun>& runs,
                                      const Pose& scene_from_world,
                                      bool prototype_too,
                                      double around_m) const;
  /// The rectangle of the projector's image that contains the prototype.
  cv::Rect prototype_rect(std::size_t projector,
                          const std::vector<PlacedRun>& runs,
                          const Pose& scene_from_world) const;

  /// Draws the prototype's ids from the reference camera and keeps them. The camera's pose in the scene is
  /// fixed by this `scene_from_world`.
  void draw_from_reference_camera(const GpuScene& scene,
                                  const std::vector<PlacedRun>& runs,
                                  const Pose& scene_from_world,
                                  const Imager& camera,
                                  const BakedLens& lens);

  const GpuLens& projector_lens(std::size_t i) const { return lenses_[i]; }
  /// Index of the viewer among the viewpoints in the shaders.
  int viewer() const { return static_cast<int>(projectors_.size()); }
  int reference_camera() const { return viewer() + 1; }
  /// Binds Resource::viewpoints.
  void bind(const Use& use) const override;

 private:
  struct GpuViewpoint;
  void draw(const GpuScene& scene,
            const std::vector<PlacedRun>& runs,
            bool (*wanted)(const PlacedRun&),
            const PinholeView& pinhole,
            const cv::Rect& within,
            const GlName& ids,
            int layer);
  void draw_triangles(const PlacedRun& placed, const PinholeView& pinhole) const;
  PinholeView projector_pinhole_view(std::size_t projector,
                                     const std::vector<PlacedRun>& runs,
                                     const Pose& scene_from_world) const;
  void draw_within(const GpuScene& scene,
                   const std::vector<PlacedRun>& runs,
                   const Pose& scene_from_world,
                   const Imager& imager,
                   const TangentRect& rect);
  void send(int index, const GpuViewpoint& viewpoint);
  void upload_pixel_map(int layer, const Imager& imager, const TangentRect& rect);

  std::vector<Imager> projectors_;
  std::vector<ProjectorResponse> responses_;
  std::vector<Focus> focuses_;
  std::vector<GpuLens> lenses_;
  Program program_, cut_program_;  // for whole triangles, and for triangles with an alpha cutoff
  std::optional<EdgeFeathering> edge_feathering_;  // only with several projectors
  std::optional<CapCounter> cap_counter_;          // only with a section
  GlName framebuffer_, depth_, projector_ids_, viewer_ids_, pixel_maps_, viewpoints_, viewpoint_texels_;
  int ids_width_ = 1, ids_height_ = 1;    // size of the texture of the projectors' ids
  std::vector<cv::Rect> surface_places_;  // texels of each projector's ids that may contain surface parts
};

}  // namespace limn::projector
