#version 450 core
// Draws a composite: one sample at the centre of each listed pixel.
#include "bindings.glsl"
#include "parts.glsl"
#include "work_list.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  imageStore(u_image, at, composite_light(visible_part_at(vec2(at)), false));
}
