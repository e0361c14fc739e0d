#version 450 core
// Writes the id of the nearest triangle in every texel.
layout(location = 0) flat in uint i_id;
layout(location = 0) out uint o_id;

void main() { o_id = i_id; }
