#version 450 core
// The id of the front triangle of every texel.
layout(location = 0) flat in uint i_id;
layout(location = 0) out uint o_id;

void main() { o_id = i_id; }
