// Pixels that want work, listed by one pass and worked through by the next: programs of their own are cheaper than
// branches. The head is what glDispatchComputeIndirect reads. Groups stand in rows: some drivers take no more than 65535
// side by side, which are the pixels of half a 4K image.
#include "bindings.glsl"

const uint k_group = 64u, k_row = 1024u;  // pixels of a group, groups of a row
layout(std430, binding = k_work_list_buffer) buffer List {
  uint s_list_count;
  uint s_list_groups[3];
  uint s_list[];  // row << 16 | column
};

void list_pixel(ivec2 at) {
  uint i = atomicAdd(s_list_count, 1u);
  s_list[i] = uint(at.y) << 16 | uint(at.x);
  if (i % k_group != 0u) return;
  atomicMax(s_list_groups[0], min(i / k_group + 1u, k_row));
  atomicMax(s_list_groups[1], i / (k_group * k_row) + 1u);
}

// Of the list that a program works through: this invocation's place in it, whether there is one, and its pixel.
uint listed_index() {
  return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * k_group + gl_LocalInvocationIndex;
}
bool is_listed() { return listed_index() < s_list_count; }
ivec2 listed_pixel() {
  uint pixel = s_list[listed_index()];
  return ivec2(pixel & 0xffffu, pixel >> 16);
}
