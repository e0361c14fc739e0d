#version 450 core
// First pass of a composite: the parts at pixel centres.
#include "parts.glsl"
layout(location = 0) out vec4 o_part;

void main() { o_part = part_at(floor(gl_FragCoord.xy)); }
