#version 450 core
// Draws the parts over the camera's image in linear light. The output is sRGB.
#include "bindings.glsl"
layout(location = 0) out vec4 o_srgb;
layout(binding = k_light_unit) uniform sampler2D s_light;                // the parts in linear light, a: coverage
layout(binding = k_camera_image_unit) uniform sampler2D s_camera_image;  // sRGB values as stored

vec3 linear_from_srgb(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045))); }
vec3 srgb_from_linear(vec3 c) {
  return mix(c * 12.92, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 part = texelFetch(s_light, at, 0);
  vec3 behind = texelFetch(s_camera_image, at, 0).rgb;
  if (part.a > 0.0) behind = srgb_from_linear(clamp(linear_from_srgb(behind) * (1.0 - part.a) + part.rgb, 0.0, 1.0));
  o_srgb = vec4(behind, 1);
}
