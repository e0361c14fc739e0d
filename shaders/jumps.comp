#version 450 core
// Marks the blocks of a depth picture in which the prototype ends or begins to hide itself: where depth jumps.
#include "blocks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(r8, binding = 0) uniform writeonly image2D u_marks;
uniform sampler2D s_depth;  // nearness: k_near / z, 0 where there is nothing
uniform ivec2 u_last;       // texel of the picture
uniform float u_near, u_focal;

// Of three in a row: a plane's nearness is even in a picture, a crease bends it, a jump breaks it.
bool is_jump(float a, float b, float c) {
  const float k_least = 0.0015;  // m
  const float k_bend = 4.0;      // texels of depth; a square corner, seen evenly, has 2
  float nearest = max(b, max(a, c));
  return abs(a - 2.0 * b + c) * u_near > max(k_least * nearest, k_bend * u_near / u_focal) * nearest;
}

float nearness(ivec2 at) { return texelFetch(s_depth, clamp(at, ivec2(0), u_last), 0).r; }

bool may_jump(ivec2 first) {
  const int k_apart = 4;
  float grid[4][4];
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) grid[y][x] = nearness(first + k_apart * ivec2(x, y) - 3);
  for (int i = 1; i < 3; ++i) {
    for (int k = 1; k < 3; ++k) {
      if (is_jump(grid[i][k - 1], grid[i][k], grid[i][k + 1])) return true;
      if (is_jump(grid[k - 1][i], grid[k][i], grid[k + 1][i])) return true;
    }
  }
  return false;
}

bool jumps(ivec2 first) {
  if (!may_jump(first)) return false;
  for (int y = 0; y < k_block; ++y) {
    for (int x = 0; x < k_block; ++x) {
      ivec2 at = first + ivec2(x, y);
      float here = nearness(at);
      if (is_jump(nearness(at - ivec2(1, 0)), here, nearness(at + ivec2(1, 0))) ||
          is_jump(nearness(at - ivec2(0, 1)), here, nearness(at + ivec2(0, 1)))) {
        return true;
      }
    }
  }
  return false;
}

void main() {
  ivec2 block = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThan(k_block * block, u_last))) return;
  imageStore(u_marks, block, vec4(jumps(k_block * block) ? 1.0 : 0.0));
}
