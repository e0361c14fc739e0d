#version 450 core
// Draws a composite at the limits of projected light. Light ends within a projector's pixel, so a camera
// pixel that is half light and half screen would be dark. Listed pixels beside a place that is left to the
// screen are therefore drawn whole, over the light.
#include "bindings.glsl"
#include "parts.glsl"
#include "listed.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!is_listed()) return;
  ivec2 at = listed_pixel();
  const float k_around = 3.0;  // width of the neighbourhood that is searched, pixels
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
