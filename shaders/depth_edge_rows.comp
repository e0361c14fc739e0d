#version 450 core
// For each block: the distance, in blocks, to the nearest marked block in its row, at most k_farthest.
#include "bindings.glsl"
#include "blocks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(r8, binding = k_edge_marks_image) uniform readonly image2D u_marks;
layout(r8, binding = k_edge_rows_image) uniform writeonly image2D u_rows;  // in 255ths
uniform ivec2 u_blocks;

void main() {
  ivec2 block = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(block, u_blocks))) return;
  int nearest = k_farthest;
  for (int x = max(0, block.x - k_farthest); x <= min(u_blocks.x - 1, block.x + k_farthest); ++x)
    if (imageLoad(u_marks, ivec2(x, block.y)).r > 0.5) nearest = min(nearest, abs(x - block.x));
  imageStore(u_rows, block, vec4(float(nearest) / 255.0));
}
