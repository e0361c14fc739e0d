// The parts as a camera sees them, in linear light; a: coverage. What projected light cannot show is drawn
// fully, the rest with the part's weight. A contact shadow has coverage but no light.
#include "seen.glsl"
#include "contact.glsl"
uniform uint u_whole[64];  // weights of what projected light can show: one byte for each owner, 255 is all

float whole_share(uint owner) {
  return owner < 256u ? float(u_whole[owner / 4u] >> (owner % 4u * 8u) & 255u) / 255.0 : 0.0;
}

vec4 shadow_at(vec3 d) {
  Sight eye = sight_at(u_eye);
  Hit prototype = first_hit(s_eye_ids, eye, 0, d);
  if (prototype.id == 0u) return vec4(0);
  return vec4(0, 0, 0, contact_shadow(eye.p_eye.xyz + prototype.t * d, facing_normal(prototype, d)));
}

// Whether a part at px must be shown by the screen.
bool is_left_to_screen(vec2 px) {
  Seen seen = in_sight_at(px);
  return seen.how == k_screen || (seen.how == k_if_reached && !is_reached(seen.behind));
}

// `whole`: also draws what light can show.
vec4 part_seen(Seen seen, bool whole) {
  if (seen.how == k_nothing) return k_contact_shadow ? shadow_at(seen.d) : vec4(0);
  float share = seen.how == k_if_reached && !whole ? whole_share(owner_of(seen.part.id)) : 1.0;
  if (share < 1.0 && !is_reached(seen.behind)) share = 1.0;
  if (share == 0.0) return vec4(0);
  float footprint = seen.part.t / sight_at(u_eye).quality.x;
  if (owner_at(owner_of(seen.part.id)).upper.w > 0.5) {  // shaded as the projectors show it
    return share * vec4(radiance_on_surface(seen.part, smooth_normal(seen.part), footprint), 1);
  }
  return share * vec4(look_along(seen.d, seen.part, footprint), 1);
}
