#version 450 core
// Lists the blocks of a depth image that may contain a depth edge. Reads every fourth texel.
#include "depth_edges.glsl"
#include "work_list.glsl"
layout(local_size_x = 16, local_size_y = 4) in;
uniform ivec2 u_first, u_end;  // the blocks to search

bool may_have_depth_edge(ivec2 first) {
  const int k_apart = 4;
  float grid[4][4];
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) grid[y][x] = nearness(first + k_apart * ivec2(x, y) - 3);
  bool is_found = false;
  for (int i = 1; i < 3; ++i) {
    for (int k = 1; k < 3; ++k) {
      is_found = is_found || is_depth_edge(grid[i][k - 1], grid[i][k], grid[i][k + 1]) ||
                 is_depth_edge(grid[k - 1][i], grid[k][i], grid[k + 1][i]);
    }
  }
  return is_found;
}

void main() {
  ivec2 block = u_first + ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(block, u_end)) && may_have_depth_edge(k_block * block)) add_to_work_list(block);
}
