#version 450 core
// Draws a projector's image: one sample at the centre of each listed pixel. Where the share is not cached
// yet, the part's colour is stored instead of the light, and the pixel is left to light_shares.comp.
#include "bindings.glsl"
#include "light.glsl"
#include "work_list.glsl"
#include "deferred_list.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  Hit prototype = cached_hit(at);
  Viewpoint projector = viewpoint_at(u_projector);
  Place place = place_at(prototype, ray_of(projector, vec2(at)));
  vec4 colour = wanted_colour(prototype, place, distance(place.p, projector.p_origin.xyz));
  if (colour.a == 0.0 && !u_even_black) return;
  if (is_share_cached(at))
    colour = vec4(balanced(u_projector, colour, cached_share(at), place, prototype), 1);
  else
    defer_pixel(at);
  imageStore(u_image, at, colour);
}
