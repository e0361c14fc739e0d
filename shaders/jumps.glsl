// Where depth jumps: where the prototype ends or begins to hide itself.
#include "bindings.glsl"
#include "blocks.glsl"

layout(binding = k_depth_unit) uniform sampler2D s_depth;  // nearness: k_near / z, 0 where there is nothing
uniform ivec2 u_last;       // texel of the image
uniform float u_near, u_focal;

// Of three in a row: a plane's nearness is even in an image, a crease bends it, a jump breaks it.
bool is_jump(float a, float b, float c) {
  const float k_least = 0.0015;  // m
  const float k_bend = 4.0;      // texels of depth; a square corner, seen evenly, has 2
  float nearest = max(b, max(a, c));
  return abs(a - 2.0 * b + c) * u_near > max(k_least * nearest, k_bend * u_near / u_focal) * nearest;
}

float nearness(ivec2 at) { return texelFetch(s_depth, clamp(at, ivec2(0), u_last), 0).r; }
