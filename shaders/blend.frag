#version 450 core
// Blending of each pixel of a projector. x: its share of the light at the prototype's point. y: light above
// its own black level that replaces the black level of projectors that do not reach the point. 0 where the
// pixel lights no point.
#include "scene.glsl"
#include "lens.glsl"
#include "projector_blending.glsl"
layout(location = 0) out vec2 o_blend;
uniform int u_projector;

void main() {
  Viewpoint projector = viewpoint_at(u_projector);
  vec3 d = ray_of(projector, floor(gl_FragCoord.xy));
  Hit hit = first_hit(s_projector_ids, projector, 0, d);
  o_blend = vec2(0);
  if (hit.id == 0u) return;
  Share share = share_of(u_projector, place_at(hit, d));
  o_blend = vec2(share.share, black_lift(share, share.missing_black));
}
