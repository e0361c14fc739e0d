#version 450 core
// Writes the id of the nearest triangle in every texel. What the plane removes is discarded, and pieces below the
// alpha cutoff.
#include "scene.glsl"
layout(location = 0) in vec3 i_weights;
layout(location = 1) in float i_height;
layout(location = 2) flat in uint i_id;
layout(location = 0) out uint o_id;
uniform float u_focal;  // focal length of the id image, texels

void main() {
  o_id = i_id;
  float depth = 1.0 / gl_FragCoord.w;
  if (i_height > -k_cut_margin) discard;
  if (is_cut_out(Hit(o_id, depth, i_weights, 0.0), depth / u_focal)) discard;
}
