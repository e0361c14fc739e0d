#version 450 core
// Writes the id of a cap, with the depth of the plane, into the texels whose rays meet the plane inside the part.
#include "cut.glsl"
layout(location = 0) out uint o_id;
layout(binding = k_cap_count_unit) uniform sampler2D s_cap_count;
uniform vec4 u_cut_in_pinhole;  // as u_cut, frame of the pinhole view
uniform vec4 u_focal_centre;    // of the pinhole view, texels
uniform float u_near;           // m
uniform uint u_owner;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  if (abs(texelFetch(s_cap_count, at, 0).x) < 0.5) discard;
  vec3 d = vec3((vec2(at) - u_focal_centre.zw) / u_focal_centre.xy, 1);
  float depth = -u_cut_in_pinhole.w / dot(u_cut_in_pinhole.xyz, d);
  if (!(depth > u_near)) discard;
  o_id = k_first_cap + u_owner;
  gl_FragDepth = u_near / depth;
}
