#version 450 core
// For each viewer pixel: the owner of the visible part (0: none) and how it is shown (1 screen, 2 projected).
#include "part_coverage.glsl"
layout(location = 0) out vec2 o_coverage;  // in 255ths

void main() {
  VisiblePart visible = classified_part_at(floor(gl_FragCoord.xy));
  o_coverage =
      visible.shown_by == k_nothing ? vec2(0) : vec2(owner_of(visible.part.id), visible.shown_by) / 255.0;
}
