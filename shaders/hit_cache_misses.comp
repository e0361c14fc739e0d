#version 450 core
// Lists the pixels of a projector whose hits are not cached.
#include "light.glsl"
#include "work_list.glsl"
layout(local_size_x = 16, local_size_y = 4) in;
uniform ivec2 u_first, u_end;  // the rectangle to search

void main() {
  ivec2 at = u_first + ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(at, u_end)) && !is_hit_cached(at)) add_to_work_list(at);
}
