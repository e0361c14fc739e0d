#version 450 core
// Finds the blocks of a depth picture in which the prototype ends or begins to hide itself: where depth jumps.
#include "blocks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba32f, binding = 0) uniform writeonly image2D u_jumps;  // texels on the jump's near side (xy) and its far side
                                                                 // (zw); x: -1 without a jump, z: nothing is there
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

// Between the texels on both sides of one.
vec4 sides(ivec2 at, ivec2 step) {
  ivec2 first = clamp(at - step, ivec2(0), u_last), second = clamp(at + step, ivec2(0), u_last);
  float before = nearness(first), after = nearness(second);
  vec4 sides = before > after ? vec4(first, second) : vec4(second, first);
  if (min(before, after) == 0.0) sides.z = -1.0;
  return sides;
}

vec4 jump(ivec2 first) {
  if (!may_jump(first)) return vec4(-1);
  for (int y = 0; y < k_block; ++y) {
    for (int x = 0; x < k_block; ++x) {
      ivec2 at = first + ivec2(x, y);
      float here = nearness(at);
      for (int k = 0; k < 2; ++k) {
        ivec2 step = ivec2(1 - k, k);
        if (is_jump(nearness(at - step), here, nearness(at + step))) return sides(at, step);
      }
    }
  }
  return vec4(-1);
}

void main() {
  ivec2 block = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThan(k_block * block, u_last))) return;
  imageStore(u_jumps, block, jump(k_block * block));
}
