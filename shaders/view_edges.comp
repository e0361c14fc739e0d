#version 450 core
// Draws a virtual camera's image: several samples for each listed pixel.
#include "bindings.glsl"
#include "view.glsl"
#include "work_list.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  draw_sharp_lines();
  vec4 sum = vec4(0);
  int k = 0;
  do {
    sum += view_at(vec2(at) + sample_offset(k));
  } while (++k < u_samples);
  imageStore(u_image, at, sum / float(u_samples));
}
