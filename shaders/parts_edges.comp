#version 450 core
// Draws a composite: several samples for each listed pixel. Pixels with a part that is not drawn whole are
// also left to parts_edges_deferred.comp.
#include "bindings.glsl"
#include "parts.glsl"
#include "work_list.glsl"
#include "deferred_list.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  draw_sharp_lines();
  vec4 sum = vec4(0);
  bool is_partial = false;
  int k = 0;
  do {
    VisiblePart visible = visible_part_at(vec2(at) + sample_offset(k));
    is_partial = is_partial || (visible.shown_by == k_if_reached && full_weight(owner_of(visible.part.id)) < 1.0) ||
                 (visible.shown_by == k_nothing && is_painted() && full_weight(0u) < 1.0);
    sum += composite_light(visible, false);
  } while (++k < u_samples);
  imageStore(u_image, at, sum / float(u_samples));
  if (is_partial) defer_pixel(at);
}
