#version 450 core
// Computes and caches the shares at the centres of the listed pixels. Where the image holds a part's colour,
// replaces it by the light.
#include "bindings.glsl"
#include "light.glsl"
#include "work_list.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  Hit prototype = cached_hit(at);
  if (prototype.id == 0u) return;
  Place place = place_at(prototype, ray_of(viewpoint_at(u_projector), vec2(at)));
  Share share = cache_share(at, place);
  vec4 colour = imageLoad(u_image, at);
  if (colour.a > 0.0 || u_even_black)
    imageStore(u_image, at, vec4(balanced(u_projector, colour, share, place, prototype), 1));
}
