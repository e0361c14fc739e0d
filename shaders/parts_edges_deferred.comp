#version 450 core
// Draws a composite at the limits of projected light. Light ends within a projector's pixel, so a camera
// pixel that is half light and half screen would be dark. Listed pixels beside a place that is left to the
// screen are therefore drawn whole, over the light.
#include "bindings.glsl"
#include "parts.glsl"
#include "work_list.glsl"
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = k_target_image) uniform writeonly image2D u_image;

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  draw_sharp_lines();
  const float k_around = 3.0;  // width of the neighbourhood that is searched, pixels
  bool is_full = false;
  int k = 0;
  do {
    is_full = is_left_to_screen(vec2(at) + k_around * sample_offset(k));
  } while (!is_full && ++k < u_samples);
  if (!is_full) return;
  vec4 sum = vec4(0);
  k = 0;
  do {
    sum += composite_light(visible_part_at(vec2(at) + sample_offset(k)), true);
  } while (++k < u_samples);
  imageStore(u_image, at, sum / float(u_samples));
}
