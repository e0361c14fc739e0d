#version 450 core
// The id of the front triangle of every texel.
layout(location = 0) out uint o_id;
uniform uint u_first_id;

void main() { o_id = u_first_id + uint(gl_PrimitiveID); }
