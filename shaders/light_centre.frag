#version 450 core
// First pass of a projector's picture: the light at pixel centres.
#include "light.glsl"
layout(location = 0) out vec4 o_light;

void main() { o_light = light_at(floor(gl_FragCoord.xy)); }
