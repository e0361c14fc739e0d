// The parts as a camera sees them, linear light, a: coverage; only what light cannot show where u_rest is set.
#include "seen.glsl"
uniform bool u_rest;

vec4 part_at(vec2 px) {
  Seen seen = seen_at(px);
  if (seen.how == k_nothing || (u_rest && seen.how == k_projected)) return vec4(0);
  Sight eye = s_sights[u_eye];
  return vec4(look_along(seen.d, seen.part, seen.part.t / eye.quality.x), 1);
}
