#version 450 core
// Draws a projector's image: one sample at the centre of each listed pixel. Where the share is not cached
// yet, the part's colour is stored instead of the light, and the pixel is left to light_shares.comp.
#include "bindings.glsl"
#include "light.glsl"
#include "listed.glsl"
#include "rest.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!is_listed()) return;
  ivec2 at = listed_pixel();
  Hit prototype = known_hit(at);
  Sight projector = sight_at(u_projector);
  Place place = place_at(prototype, ray_of(projector, vec2(at)));
  vec4 colour = wanted_colour(place, distance(place.p, projector.p_eye.xyz));
  if (colour.a == 0.0 && !u_even_black) return;
  if (is_share_known(at))
    colour = vec4(balanced(u_projector, colour, known_share(at), place, prototype), 1);
  else
    leave_pixel(at);
  imageStore(u_image, at, colour);
}
