#version 450 core
// For each viewer pixel: the owner of the visible part (0: none) and how it is shown (1 screen, 2 projected).
#include "seen.glsl"
layout(location = 0) out vec2 o_seen;  // in 255ths

void main() {
  Seen seen = seen_at(floor(gl_FragCoord.xy));
  o_seen = seen.how == k_nothing ? vec2(0) : vec2(owner_of(seen.part.id), seen.how) / 255.0;
}
