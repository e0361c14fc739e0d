#version 450 core
// Computes where the rays of a projector's pixel centres hit the prototype, for a rectangle or (LISTED) for
// listed pixels.
#include "light.glsl"
#ifdef LISTED
#include "listed.glsl"
layout(local_size_x = 64) in;

void main() {
  if (is_listed()) learn_hit(listed_pixel());
}
#else
layout(local_size_x = 16, local_size_y = 4) in;
uniform ivec2 u_first, u_end;  // the rectangle

void main() {
  ivec2 at = u_first + ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(at, u_end))) learn_hit(at);
}
#endif
