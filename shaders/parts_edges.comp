#version 450 core
// A composite: the listed pixels by many samples.
#include "parts.glsl"
#include "listed.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = 0) uniform writeonly image2D u_picture;

void main() {
  if (gl_GlobalInvocationID.x >= s_list_count) return;
  ivec2 at = listed_pixel(gl_GlobalInvocationID.x);
  vec4 sum = vec4(0);
  for (int k = 0; k < u_samples; ++k) sum += part_at(vec2(at) + sample_offset(k));
  imageStore(u_picture, at, sum / float(u_samples));
}
