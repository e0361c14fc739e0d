// A list of pixels that a pass leaves to a later one, for work that only few pixels need.
#include "bindings.glsl"

layout(std430, binding = k_deferred_list_buffer) buffer Rest {
  uint s_rest_count;
  uint s_rest_groups[3];
  uint s_rest[];  // same format as shaders/listed.glsl, which reads it
};

void leave_pixel(ivec2 at) {
  uint i = atomicAdd(s_rest_count, 1u);
  s_rest[i] = uint(at.y) << 16 | uint(at.x);
  if (i % k_group != 0u) return;
  atomicMax(s_rest_groups[0], min(i / k_group + 1u, k_row));
  atomicMax(s_rest_groups[1], i / (k_group * k_row) + 1u);
}
