#version 450 core
// Counts the surfaces that a texel's ray passes on the kept side of the plane: out of a piece 1, into it -1. The sum
// is not 0 where the ray meets the plane inside a piece.
#include "cut.glsl"
layout(location = 1) in float i_height;
layout(location = 0) out float o_count;

void main() {
  if (i_height > -k_cut_margin) discard;
  o_count = gl_FrontFacing ? 1.0 : -1.0;
}
