#version 450 core
// Computes where the rays of a projector's pixel centres hit the prototype, for a rectangle or (WORK_LIST)
// for listed pixels.
#include "light.glsl"
#ifdef WORK_LIST
#include "work_list.glsl"
layout(local_size_x = 64) in;

void main() {
  if (has_work()) cache_hit(work_pixel());
}
#else
layout(local_size_x = 16, local_size_y = 4) in;
uniform ivec2 u_first, u_end;  // the rectangle

void main() {
  ivec2 at = u_first + ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(at, u_end))) cache_hit(at);
}
#endif
