#version 450 core
// Second pass of a projector's picture: more samples at edges, then display values by the projector's response.
#include "light.glsl"
#include "refine.glsl"
layout(location = 0) out vec4 o_display;
uniform sampler2D s_response;  // display value over light^(1/2.2), evenly spaced from 0 to 1

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
  if (is_at_edge(at)) {
    light = vec4(0);
    for (int k = 0; k < k_samples * k_samples; ++k) light += light_at(vec2(at) + sample_offset(k));
    light /= float(k_samples * k_samples);
  }
  o_display = vec4(light.a > 0.0 ? display_value(light.rgb) : vec3(0), 1);
}
