// The parts as a camera sees them, linear light, a: coverage; of those that are not to be whole only what light
// cannot show. A shadow covers without giving light.
#include "seen.glsl"
#include "contact.glsl"
uniform uint u_whole[8];  // a bit an owner

bool is_whole(uint owner) { return owner < 256u && (u_whole[owner / 32u] >> (owner % 32u) & 1u) == 1u; }

vec4 shadow_at(vec3 d) {
  Sight eye = s_sights[u_eye];
  Hit prototype = first_hit(s_eye_ids, eye, 0, d);
  if (prototype.id == 0u) return vec4(0);
  return vec4(0, 0, 0, contact_shadow(eye.p_eye.xyz + prototype.t * d, facing_normal(prototype, d)));
}

vec4 part_at(vec2 px) {
  Seen seen = in_sight_at(px);
  if (seen.how == k_nothing) return u_contact_shadow ? shadow_at(seen.d) : vec4(0);
  if (seen.how == k_if_reached && !is_whole(owner_of(seen.part.id)) && is_reached(seen.behind))
    return vec4(0);
  float footprint = seen.part.t / s_sights[u_eye].quality.x;
  if (s_placements[owner_of(seen.part.id)].upper.w > 0.5) {  // as the projectors show it
    return vec4(look_on_surface(seen.part, smooth_normal(seen.part), footprint), 1);
  }
  return vec4(look_along(seen.d, seen.part, footprint), 1);
}
