#version 450 core
// How each pixel of a projector is to be blended. x: its share of the light at the prototype's point, y: light over its
// black that makes up for projectors that do not reach the point; 0 where there is none.
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
layout(location = 0) out vec2 o_blend;
uniform int u_projector;

void main() {
  Sight projector = sight_at(u_projector);
  vec3 d = ray_of(projector, floor(gl_FragCoord.xy));
  Hit hit = first_hit(s_projector_ids, projector, 0, d);
  o_blend = vec2(0);
  if (hit.id == 0u) return;
  Share share = share_of(u_projector, place_at(hit, d));
  o_blend = vec2(share.share, black_lift(share, share.missing_black));
}
