// The parts as a camera sees them, linear light, a: coverage; only what light cannot show where u_rest is set.
#include "seen.glsl"
uniform bool u_rest;

vec4 part_at(vec2 px) {
  Seen seen = seen_at(px);
  if (seen.how == k_nothing || (u_rest && seen.how == k_projected)) return vec4(0);
  float footprint = seen.part.t / s_sights[u_eye].quality.x;
  if (s_placements[owner_of(seen.part.id)].upper.w > 0.5) {  // as the projectors show it
    return vec4(look_on_surface(seen.part, smooth_normal(seen.part), footprint), 1);
  }
  return vec4(look_along(seen.d, seen.part, footprint), 1);
}
