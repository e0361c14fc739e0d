#version 450 core
// Triangles of one owner, to be drawn as their ids.
layout(location = 0) in vec4 a_corner;
uniform mat4 u_clip_from_owner;

void main() { gl_Position = u_clip_from_owner * vec4(a_corner.xyz, 1); }
