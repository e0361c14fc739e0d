#version 450 core
// Second pass of a projector's picture: more samples at edges, then display values by the projector's response. Alpha
// says what was clipped.
#include "light.glsl"
#include "refine.glsl"
layout(location = 0) out vec4 o_display;
uniform sampler2D s_response;  // display value over light^(1/2.2), evenly spaced from 0 to 1

const float k_dark_edge = 0.001;  // of full light: a step between blacks

// Even noise of 0 ... 1, the same every time (Jimenez 2014, "Next Generation Post Processing in Call of Duty: Advanced
// Warfare", interleaved gradient noise).
float dither(vec2 at) { return fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715)))); }

vec3 display_value(vec3 light) {
  float nodes = float(textureSize(s_response, 0).x);
  vec3 at = pow(clamp(light, 0.0, 1.0), vec3(1.0 / 2.2)) * (nodes - 1.0);
  vec3 out_value;
  for (int c = 0; c < 3; ++c) {
    int first = min(int(at[c]), int(nodes) - 2);
    out_value[c] = mix(texelFetch(s_response, ivec2(first, 0), 0)[c], texelFetch(s_response, ivec2(first + 1, 0), 0)[c],
                       at[c] - float(first));
  }
  return out_value;
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 light = texelFetch(s_centre, at, 0);
  if (is_at_edge(at, u_even_black ? k_dark_edge : k_edge)) {
    light = vec4(0);
    for (int k = 0; k < k_samples * k_samples; ++k) light += light_at(vec2(at) + sample_offset(k));
    light /= float(k_samples * k_samples);
  }
  // 1: brighter than light can be is wanted, 0.5: darker.
  const float k_tolerance = 0.004;
  float clipped = any(greaterThan(light.rgb, vec3(1.0 + k_tolerance))) ? 1.0
                  : any(lessThan(light.rgb, vec3(-k_tolerance)))       ? 0.5
                                                                       : 0.0;
  if (u_compensation == k_as_it_is && !u_even_black) {
    o_display = vec4(light.a > 0.0 ? display_value(light.rgb) : vec3(0), clipped);
    return;
  }
  float black = s_sights[u_projector].quality.w;
  vec3 value = light.a > 0.0 ? display_value(black + (1.0 - black) * light.rgb) : vec3(0);
  // Without noise smooth light would have bands of whole levels; black and white stay what they are.
  vec3 inner = step(vec3(0.5 / 255.0), value) * step(value, vec3(254.5 / 255.0));
  o_display = vec4(value + inner * (dither(vec2(at)) - 0.5) / 255.0, clipped);
}
