#version 450 core
// Draws a composite: several samples for each listed pixel. Pixels with a part that is not drawn whole are
// also left to parts_rest.comp.
#include "bindings.glsl"
#include "parts.glsl"
#include "listed.glsl"
#include "rest.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!is_listed()) return;
  ivec2 at = listed_pixel();
  vec4 sum = vec4(0);
  bool may_lack = false;
  int k = 0;
  do {
    Seen seen = in_sight_at(vec2(at) + sample_offset(k));
    may_lack = may_lack || (seen.how == k_if_reached && whole_share(owner_of(seen.part.id)) < 1.0);
    sum += part_seen(seen, false);
  } while (++k < u_samples);
  imageStore(u_image, at, sum / float(u_samples));
  if (may_lack) leave_pixel(at);
}
