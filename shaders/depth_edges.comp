#version 450 core
// Finds a depth edge in each of the listed blocks, and lists the blocks that have one for
// shaders/depth_edge_handover.comp.
#include "bindings.glsl"
#include "depth_edges.glsl"
#include "work_list.glsl"
#include "deferred_list.glsl"
layout(local_size_x = 64) in;
// Texels on the near side of the edge (xy) and on its far side (zw). x: -1 without an edge; z: -1 when the
// far side is empty.
layout(rgba32f, binding = k_depth_edges_image) uniform writeonly image2D u_depth_edges;

// The two texels beside the texel `at`, the nearer one first.
vec4 sides(ivec2 at, ivec2 step) {
  ivec2 first = clamp(at - step, ivec2(0), u_last), second = clamp(at + step, ivec2(0), u_last);
  float before = nearness(first), after = nearness(second);
  vec4 sides = before > after ? vec4(first, second) : vec4(second, first);
  if (min(before, after) == 0.0) sides.z = -1.0;
  return sides;
}

// The first edge in a block, row by row; for each texel, along the row first, then along the column.
vec4 depth_edge_in(ivec2 first) {
  vec4 found = vec4(-1);
  int i = 0;
  do {
    ivec2 at = first + ivec2(i % k_block, i / k_block);
    float here = nearness(at);
    if (is_depth_edge(nearness(at - ivec2(1, 0)), here, nearness(at + ivec2(1, 0))))
      found = sides(at, ivec2(1, 0));
    else if (is_depth_edge(nearness(at - ivec2(0, 1)), here, nearness(at + ivec2(0, 1))))
      found = sides(at, ivec2(0, 1));
  } while (found.x < 0.0 && ++i < k_block * k_block);
  return found;
}

void main() {
  if (!has_work()) return;
  ivec2 block = work_pixel();
  vec4 found = depth_edge_in(k_block * block);
  if (found.x < 0.0) return;
  imageStore(u_depth_edges, block, found);
  defer_pixel(block);
}
