// The light that one pixel sample of a projector should give.
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
#include "look.glsl"
#include "on_surface.glsl"
#include "balance.glsl"

uniform usampler2DArray s_eye_ids;
uniform int u_projector;
uniform int u_eye;  // sight of the viewer
uniform int u_placement_count;
uniform bool u_has_view_parts, u_has_surface_parts;

// Colour of the view part that the viewer sees before p; a: 0 when none, or when p is hidden from the viewer.
vec4 view_colour(vec3 p, vec3 d_normal, float footprint) {
  Sight eye = s_sights[u_eye];
  vec3 d = p - eye.p_eye.xyz;
  float t = length(d);
  d /= t;
  if (dot(d_normal, d) >= 0.0) return vec4(0);  // the viewer looks at the other side
  Hit hit = first_hit(s_eye_ids, eye, 1, d);
  if (hit.id == 0u || hit.t > t || s_placements[owner_of(hit.id)].upper.w > 0.5) return vec4(0);
  if (is_hidden(s_eye_ids, eye, p)) return vec4(0);
  return vec4(look_along(d, hit, footprint), 1);
}

vec4 surface_colour(Place place, float footprint) {
  if (!may_hold_surface_part(place.p, u_placement_count)) return vec4(0);
  Hit hit = surface_part_at(s_projector_ids, s_sights[u_projector], place.p, place.d_smooth);
  return hit.id == 0u ? vec4(0) : vec4(look_on_surface(hit, place.d_smooth, footprint), 1);
}

// rgb: light; a: coverage by what is to be lit.
vec4 light_at(vec2 px) {
  Sight projector = s_sights[u_projector];
  vec3 d = ray_of(projector, px);
  Hit prototype = first_hit(s_projector_ids, projector, 0, d);
  if (prototype.id == 0u) return vec4(0);
  Place place = place_at(prototype, d);
  float footprint = prototype.t / projector.quality.x;
  vec4 colour = u_has_view_parts ? view_colour(place.p, place.d_flat, footprint) : vec4(0);
  if (colour.a == 0.0 && u_has_surface_parts) colour = surface_colour(place, footprint);
  if (colour.a == 0.0 && !u_even_black) return colour;
  return vec4(balanced(u_projector, colour, place, prototype), 1);
}

// False only where light_at is 0 for certain: no part is seen there from the viewer's eye, and none lies there.
bool may_give_light(vec2 px) {
  Sight projector = s_sights[u_projector];
  vec3 d = ray_of(projector, px);
  Hit prototype = first_hit(s_projector_ids, projector, 0, d);
  if (prototype.id == 0u) return false;
  vec3 p = projector.p_eye.xyz + prototype.t * d;
  vec4 share;
  Sight eye = s_sights[u_eye];
  return u_even_black ||
         (u_has_view_parts && ids_around(s_eye_ids, eye, 1, p - eye.p_eye.xyz, share) != uvec4(0)) ||
         (u_has_surface_parts && may_hold_surface_part(p, u_placement_count));
}
