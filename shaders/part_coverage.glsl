// Which part an imager (viewer or camera) sees at a pixel sample, and whether projected light can show it.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "projector_blending.glsl"
#include "finish.glsl"
#include "on_surface.glsl"

layout(binding = k_viewer_ids_unit) uniform usampler2DArray s_viewer_ids;
uniform int u_viewer;

const int k_nothing = 0, k_screen = 1, k_projected = 2, k_if_reached = 3;

struct VisiblePart {
  int shown_by;
  Hit part;
  vec3 d;
  Place behind;  // the prototype's place behind the part, if `shown_by` is k_if_reached
};

// The part at px, unless the prototype hides it. A surface part counts as visible up to 2 mm behind the
// surface. k_if_reached: projected if light reaches the prototype there, else left to the screen.
VisiblePart visible_part_at(vec2 px) {
  Viewpoint viewer = viewpoint_at(u_viewer);
  vec3 d = ray_of(viewer, px);
  VisiblePart visible =
      VisiblePart(k_nothing, first_hit(s_viewer_ids, viewer, 1, d), d, Place(vec3(0), vec3(0), vec3(0)));
  if (visible.part.id == 0u) return visible;
  bool on_surface = owner_at(owner_of(visible.part.id)).upper.w > 0.5;
  Hit prototype = first_hit(s_viewer_ids, viewer, 0, d);
  if (prototype.id == 0u) {
    visible.shown_by = k_screen;
    return visible;
  }
  Place behind = place_at(prototype, d);
  // Height of the part above the surface.
  float height = (prototype.t - visible.part.t) * -dot(behind.d_flat, d);
  if (height < (on_surface ? -k_on_surface : -k_same_place)) return visible;
  bool may_be_projected = !on_surface || (height <= k_on_surface && !is_cap(visible.part.id));
  visible.shown_by = may_be_projected ? k_if_reached : k_screen;
  visible.behind = behind;
  return visible;
}

// The same, where k_if_reached is replaced by k_projected or k_screen.
VisiblePart classified_part_at(vec2 px) {
  VisiblePart visible = visible_part_at(px);
  if (visible.shown_by == k_if_reached) visible.shown_by = is_reached(visible.behind) ? k_projected : k_screen;
  return visible;
}
