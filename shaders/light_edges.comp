#version 450 core
// Draws a projector's image: several samples for each listed pixel. Pixels with samples that cannot use the
// centre's share are left to light_rest.comp.
#include "bindings.glsl"
#include "light.glsl"
#include "listed.glsl"
#include "rest.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!is_listed()) return;
  ivec2 at = listed_pixel();
  CentreShare centre = centre_share(at);
  vec4 sum = vec4(0);
  bool is_left = false;
  int k = 0;
  do {
    Sample seen = sample_at(vec2(at) + sample_offset(k), centre);
    if (seen.is_lit) sum += light_of(seen, centre.share);
    is_left = is_left || (seen.is_lit && !seen.is_beside);
  } while (++k < u_samples);
  if (is_left)
    leave_pixel(at);
  else
    imageStore(u_image, at, sum / float(u_samples));
}
