#version 450 core
// A composite: light ends within a pixel of the projector's, and a pixel half of light, half of screen would be dark. Of
// the listed pixels those beside what is left to the screen get the part whole, over its light.
#include "bindings.glsl"
#include "parts.glsl"
#include "listed.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!is_listed()) return;
  ivec2 at = listed_pixel();
  const float k_around = 3.0;  // pixels across that are looked at
  bool whole = false;
  int k = 0;
  do {
    whole = is_left_to_screen(vec2(at) + k_around * sample_offset(k));
  } while (!whole && ++k < u_samples);
  if (!whole) return;
  vec4 sum = vec4(0);
  k = 0;
  do {
    sum += part_seen(in_sight_at(vec2(at) + sample_offset(k)), true);
  } while (++k < u_samples);
  imageStore(u_image, at, sum / float(u_samples));
}
