#version 450 core
// Draws a projector's image: several samples for each listed pixel. A sample that cannot use the centre's
// share computes its own.
#include "bindings.glsl"
#include "light.glsl"
#include "work_list.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  draw_sharp_lines();
  CentreShare centre = centre_share(at);
  vec4 sum = vec4(0);
  int k = 0;
  do {
    Sample s = sample_at(vec2(at) + sample_offset(k), centre);
    Share share = centre.share;
    if (!s.uses_centre_share) share = share_of(u_projector, s.place);
    if (s.gives_light) sum += light_of(s, share);
  } while (++k < u_samples);
  imageStore(u_image, at, sum / float(u_samples));
}
