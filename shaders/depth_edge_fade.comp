#version 450 core
// For each block: the feathering weight of the projector near depth edges, 0 in a block with an edge and in
// its neighbours, 1 far away.
#include "bindings.glsl"
#include "blocks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(r8, binding = k_edge_rows_image) uniform readonly image2D u_rows;
layout(r16f, binding = k_edge_fade_image) uniform writeonly image2D u_fade;
uniform ivec2 u_blocks;

void main() {
  ivec2 block = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(block, u_blocks))) return;
  float nearest_2 = float(k_farthest * k_farthest);
  for (int y = max(0, block.y - k_farthest); y <= min(u_blocks.y - 1, block.y + k_farthest); ++y) {
    float across = float(y - block.y), along = 255.0 * imageLoad(u_rows, ivec2(block.x, y)).r;
    nearest_2 = min(nearest_2, across * across + along * along);
  }
  const float k_neighbours = 1.5;  // also the diagonal neighbours, so that interpolation gives 0 everywhere
                                   // in a block with an edge
  imageStore(u_fade, block, vec4(smoothstep(k_neighbours, k_neighbours + float(k_fade), sqrt(nearest_2))));
}
