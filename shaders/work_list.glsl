// A list of pixels, filled by one pass and processed by the next. Separate programs are cheaper than
// branches. Its head holds the group counts that glDispatchComputeIndirect reads. The groups form a 2D grid,
// because some drivers allow at most 65535 groups in one dimension, which is half a 4K image.
#include "bindings.glsl"

const uint k_group = 64u, k_row = 1024u;  // pixels in a group, groups in a row
layout(std430, binding = k_work_list_buffer) buffer WorkList {
  uint s_work_list_count;
  uint s_work_list_groups[3];
  uint s_work_list[];  // row << 16 | column
};

void add_to_work_list(ivec2 at) {
  uint i = atomicAdd(s_work_list_count, 1u);
  s_work_list[i] = uint(at.y) << 16 | uint(at.x);
  if (i % k_group != 0u) return;
  atomicMax(s_work_list_groups[0], min(i / k_group + 1u, k_row));
  atomicMax(s_work_list_groups[1], i / (k_group * k_row) + 1u);
}

// For a program that processes the list: the index of this invocation, whether it has an entry, and its
// pixel.
uint work_index() {
  return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * k_group + gl_LocalInvocationIndex;
}
bool has_work() { return work_index() < s_work_list_count; }
ivec2 work_pixel() {
  uint pixel = s_work_list[work_index()];
  return ivec2(pixel & 0xffffu, pixel >> 16);
}
