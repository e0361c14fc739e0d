// A list of pixels that a pass leaves to a later one, for work that only few pixels need.
#include "bindings.glsl"

layout(std430, binding = k_deferred_list_buffer) buffer DeferredList {
  uint s_deferred_count;
  uint s_deferred_groups[3];
  uint s_deferred[];  // same format as shaders/work_list.glsl, which reads it
};

void defer_pixel(ivec2 at) {
  uint i = atomicAdd(s_deferred_count, 1u);
  s_deferred[i] = uint(at.y) << 16 | uint(at.x);
  if (i % k_group != 0u) return;
  atomicMax(s_deferred_groups[0], min(i / k_group + 1u, k_row));
  atomicMax(s_deferred_groups[1], i / (k_group * k_row) + 1u);
}
