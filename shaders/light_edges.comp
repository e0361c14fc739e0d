#version 450 core
// Draws a projector's image: several samples for each listed pixel. Pixels with samples that cannot use the
// centre's share are left to light_edges_deferred.comp.
#include "bindings.glsl"
#include "light.glsl"
#include "work_list.glsl"
#include "deferred_list.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  draw_sharp_lines();
  CentreShare centre = centre_share(at);
  vec4 sum = vec4(0);
  bool is_deferred = false;
  int k = 0;
  do {
    Sample s = sample_at(vec2(at) + sample_offset(k), centre);
    if (s.gives_light) sum += light_of(s, centre.share);
    is_deferred = is_deferred || (s.gives_light && !s.uses_centre_share);
  } while (++k < u_samples);
  if (is_deferred)
    defer_pixel(at);
  else
    imageStore(u_image, at, sum / float(u_samples));
}
