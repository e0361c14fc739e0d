// The parts as a camera sees them, linear light, a: coverage; only what light cannot show where u_rest is set. A shadow
// covers without giving light.
#include "seen.glsl"
#include "contact.glsl"
uniform bool u_rest;

vec4 shadow_at(vec3 d) {
  Sight eye = s_sights[u_eye];
  Hit prototype = first_hit(s_eye_ids, eye, 0, d);
  if (prototype.id == 0u) return vec4(0);
  return vec4(0, 0, 0, contact_shadow(eye.p_eye.xyz + prototype.t * d, facing_normal(prototype, d)));
}

vec4 part_at(vec2 px) {
  Seen seen = seen_at(px);
  if (seen.how == k_nothing) return u_contact_shadow ? shadow_at(seen.d) : vec4(0);
  if (u_rest && seen.how == k_projected) return vec4(0);
  float footprint = seen.part.t / s_sights[u_eye].quality.x;
  if (s_placements[owner_of(seen.part.id)].upper.w > 0.5) {  // as the projectors show it
    return vec4(look_on_surface(seen.part, smooth_normal(seen.part), footprint), 1);
  }
  return vec4(look_along(seen.d, seen.part, footprint), 1);
}
