// Depth edges (discontinuities): where the prototype ends or hides itself.
#include "bindings.glsl"
#include "blocks.glsl"

layout(binding = k_depth_unit) uniform sampler2D s_depth;  // nearness: k_near / z, 0 where it is empty
uniform ivec2 u_last;       // last texel of the image
uniform float u_near, u_focal;

// Whether three texels in a row contain an edge. The nearness of a plane is linear in the image, a crease
// bends it, an edge breaks it.
bool is_depth_edge(float a, float b, float c) {
  const float k_least = 0.0015;  // m
  const float k_bend = 4.0;      // texels of depth; a right-angled corner seen symmetrically has 2
  float nearest = max(b, max(a, c));
  return abs(a - 2.0 * b + c) * u_near > max(k_least * nearest, k_bend * u_near / u_focal) * nearest;
}

float nearness(ivec2 at) { return texelFetch(s_depth, clamp(at, ivec2(0), u_last), 0).r; }
