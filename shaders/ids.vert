#version 450 core
// Triangles of one owner, which are drawn as their ids. (gl_PrimitiveID would be slower on software GL, which
// would have to split its triangles.)
layout(location = 0) in vec4 a_corner;
layout(location = 0) flat out uint o_id;
uniform mat4 u_clip_from_owner;

void main() {
  o_id = uint(gl_VertexID) / 3u + 1u;
  gl_Position = u_clip_from_owner * vec4(a_corner.xyz, 1);
}
