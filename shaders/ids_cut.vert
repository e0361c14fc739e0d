#version 450 core
// Triangles of one owner that may have an alpha cutoff, which are drawn as their ids.
layout(location = 0) in vec4 a_corner;
layout(location = 0) out vec3 o_weights;  // barycentric
layout(location = 1) flat out uint o_id;
uniform mat4 u_clip_from_owner;

void main() {
  gl_Position = u_clip_from_owner * vec4(a_corner.xyz, 1);
  o_id = uint(gl_VertexID) / 3u + 1u;
  o_weights = vec3(equal(ivec3(gl_VertexID % 3), ivec3(0, 1, 2)));
}
