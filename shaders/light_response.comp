#version 450 core
// Converts a projector's light into display values by its response, for the listed pixels. Alpha says where
// it was clipped.
#include "bindings.glsl"
#include "scene.glsl"
#include "work_list.glsl"
layout(local_size_x = 64) in;
layout(rgba8, binding = k_target_image) uniform writeonly image2D u_display;
layout(binding = k_light_unit) uniform sampler2D s_light;  // linear light, a: coverage
// Display value as a function of the square root of light, evenly spaced from 0 to 1.
layout(binding = k_response_unit) uniform sampler2D s_response;
uniform int u_projector;
uniform ivec2 u_first, u_end;  // the rectangle that is written
uniform bool u_is_balanced;    // light is relative to the black level, and is dithered against banding

// Ordered dithering with the 4 x 4 matrix (Bayer 1973), values 0 to 1. In the dark, levels differ by up to 15
// %; after the viewer's blur of one or two pixels less than 1 % is left.
const float k_dither[16] = float[](0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5);
float dither(ivec2 at) { return (k_dither[4 * (at.y & 3) + (at.x & 3)] + 0.5) / 16.0; }

vec3 display_value(vec3 light) {
  float nodes = float(textureSize(s_response, 0).x);
  vec3 at = sqrt(clamp(light, 0.0, 1.0)) * (nodes - 1.0);
  vec3 out_value;
  for (int c = 0; c < 3; ++c) {
    int first = min(int(at[c]), int(nodes) - 2);
    out_value[c] = mix(texelFetch(s_response, ivec2(first, 0), 0)[c], texelFetch(s_response, ivec2(first + 1, 0), 0)[c],
                       at[c] - float(first));
  }
  return out_value;
}

void main() {
  if (!has_work()) return;
  ivec2 at = work_pixel();
  if (any(lessThan(at, u_first)) || any(greaterThanEqual(at, u_end))) return;
  vec4 light = texelFetch(s_light, at, 0);
  // 1: the wanted light is brighter than possible, 0.5: darker than possible.
  const float k_tolerance = 0.004;
  float clipped = any(greaterThan(light.rgb, vec3(1.0 + k_tolerance))) ? 1.0
                  : any(lessThan(light.rgb, vec3(-k_tolerance)))       ? 0.5
                                                                       : 0.0;
  float black = u_is_balanced ? viewpoint_at(u_projector).quality.w : 0.0;
  vec3 value = light.a > 0.0 ? display_value(black + (1.0 - black) * light.rgb) : vec3(0);
  if (u_is_balanced) {
    // Dithering avoids bands of whole levels in smooth light. Full black and full white are not changed.
    vec3 inner = step(vec3(0.5 / 255.0), value) * step(value, vec3(254.5 / 255.0));
    value += inner * (dither(at) - 0.5) / 255.0;
  }
  imageStore(u_display, at, vec4(value, clipped));
}
