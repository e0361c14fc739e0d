// Pixels that want work, listed by one pass and worked through by the next: programs of their own are cheaper than
// branches. The head is what glDispatchComputeIndirect reads.

const uint k_group = 64u;
layout(std430, binding = 6) buffer List {
  uint s_list_count;
  uint s_list_groups[3];
  uint s_list[];  // row << 16 | column
};

uint list_pixel(ivec2 at) {
  uint i = atomicAdd(s_list_count, 1u);
  s_list[i] = uint(at.y) << 16 | uint(at.x);
  if (i % k_group == 0u) atomicMax(s_list_groups[0], i / k_group + 1u);
  return i;
}

ivec2 listed_pixel(uint i) { return ivec2(s_list[i] & 0xffffu, s_list[i] >> 16); }
