#version 450 core
// Finds the jump of depth in each of the listed blocks, if there is one, and leaves those to shaders/jump_handed.comp.
#include "bindings.glsl"
#include "jumps.glsl"
#include "listed.glsl"
#include "rest.glsl"
layout(local_size_x = 64) in;
// Texels on the jump's near side (xy) and its far side (zw); x: -1 without a jump, z: nothing is there.
layout(rgba32f, binding = k_depth_edges_image) uniform writeonly image2D u_jumps;

// Between the texels on both sides of one.
vec4 sides(ivec2 at, ivec2 step) {
  ivec2 first = clamp(at - step, ivec2(0), u_last), second = clamp(at + step, ivec2(0), u_last);
  float before = nearness(first), after = nearness(second);
  vec4 sides = before > after ? vec4(first, second) : vec4(second, first);
  if (min(before, after) == 0.0) sides.z = -1.0;
  return sides;
}

// The first in the rows of a block, along its row before along its column.
vec4 jump(ivec2 first) {
  vec4 found = vec4(-1);
  int i = 0;
  do {
    ivec2 at = first + ivec2(i % k_block, i / k_block);
    float here = nearness(at);
    if (is_jump(nearness(at - ivec2(1, 0)), here, nearness(at + ivec2(1, 0))))
      found = sides(at, ivec2(1, 0));
    else if (is_jump(nearness(at - ivec2(0, 1)), here, nearness(at + ivec2(0, 1))))
      found = sides(at, ivec2(0, 1));
  } while (found.x < 0.0 && ++i < k_block * k_block);
  return found;
}

void main() {
  if (!is_listed()) return;
  ivec2 block = listed_pixel();
  vec4 found = jump(k_block * block);
  if (found.x < 0.0) return;
  imageStore(u_jumps, block, found);
  leave_pixel(block);
}
