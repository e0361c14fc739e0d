#pragma once

#include "core/result.h"
#include "projector/gl.h"
#include "projector/gpu_scene.h"
#include "projector/pinhole_view.h"
#include "projector/shader.h"

namespace limn::projector {

/// Draws into images of triangle ids what a plane leaves of parts, and the caps that close the openings
/// (shaders/ids_open.vert, cap_count.frag, cap_ids.frag).
///
/// A texel shows the cap of a part where its ray meets the plane inside the part: there the ray leaves the
/// kept side's surfaces more often than it enters them. Each surface counts once in each texel, because
/// neighbouring triangles share no texel and leave none out; so a cap has no hole, wherever the plane runs,
/// and pieces within pieces are left open or filled as they wind. Pieces that do not close (sheets) have no
/// inside and are not counted: they are cut, without a cap.
class CapCounter {
 public:
  /// For id images of at most this size.
  static Result<CapCounter> create(int width, int height);

  /// The program that draws the ids of a part that is cut, with its uniforms set.
  const Program& ids_program(const PlacedRun& placed, const PinholeView& pinhole) const;

  /// Draws the cap of a part over the ids and depths of `framebuffer`, within `texels`. `draw_triangles`
  /// draws the part's triangles.
  template <class DrawTriangles>
  void draw_cap(const GpuScene& scene,
                const PlacedRun& placed,
                const PinholeView& pinhole,
                const cv::Rect& texels,
                const GlName& framebuffer,
                const DrawTriangles& draw_triangles) const {
    begin_count(scene, placed, pinhole, texels);
    draw_triangles();
    end_count(placed, pinhole, framebuffer);
  }

 private:
  void begin_count(const GpuScene& scene,
                   const PlacedRun& placed,
                   const PinholeView& pinhole,
                   const cv::Rect& texels) const;
  void end_count(const PlacedRun& placed, const PinholeView& pinhole, const GlName& framebuffer) const;

  Program ids_, count_, cap_;
  GlName counts_, framebuffer_, vertex_array_;
};

/// The plane as coefficients: its product with (p, 1) is the height of p over it. A plane that cuts nothing
/// where there is none.
Eigen::Vector4f coefficients(const std::optional<scene::CutPlane>& cut);

/// Whether the plane removes all of a box of the part (frame of the part).
bool is_removed(const PlacedRun& placed, const Eigen::AlignedBox3d& box);

}  // namespace limn::projector
