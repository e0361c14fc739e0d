#version 450 core
// Triangles of one owner that a plane cuts, which are drawn as their ids. COUNT_CAP: only those of pieces that close.
#include "scene.glsl"
layout(location = 0) in vec4 a_corner;
layout(location = 0) out vec3 o_weights;  // barycentric
layout(location = 1) out float o_height;  // over the plane, m
layout(location = 2) flat out uint o_id;
uniform mat4 u_clip_from_owner;
uniform vec4 u_cut_in_owner;  // as u_cut, frame of the owner

void main() {
  gl_Position = u_clip_from_owner * vec4(a_corner.xyz, 1);
  o_id = uint(gl_VertexID) / 3u + 1u;
  o_weights = vec3(equal(ivec3(gl_VertexID % 3), ivec3(0, 1, 2)));
  o_height = dot(u_cut_in_owner.xyz, a_corner.xyz) + u_cut_in_owner.w;
#ifdef COUNT_CAP
  if (is_of_sheet(o_id)) gl_Position = vec4(2, 2, 2, 1);  // outside
#endif
}
