#version 450 core
// Draws a virtual camera's image: one sample at the centre of each listed pixel.
#include "bindings.glsl"
#include "view.glsl"
#include "work_list.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  imageStore(u_image, at, view_at(vec2(at)));
}
