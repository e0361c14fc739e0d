// Where a picture of one sample a pixel needs more: beside an edge of coverage or colour.

uniform sampler2D s_centre;  // linear light, a: coverage

const float k_edge = 0.02;  // of full light; a smaller step beside light is not seen
const int k_samples = 4;    // a side of a pixel

bool is_at_edge(ivec2 at, float least) {
  ivec2 last = textureSize(s_centre, 0) - 1;
  vec4 lowest = vec4(1e9), highest = vec4(-1e9);
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) {
      vec4 c = texelFetch(s_centre, clamp(at + ivec2(x, y), ivec2(0), last), 0);
      lowest = min(lowest, c);
      highest = max(highest, c);
    }
  }
  return any(greaterThan(highest - lowest, vec4(least)));
}

// Place of sample k in the pixel, from its centre.
vec2 sample_offset(int k) {
  return (vec2(k % k_samples, k / k_samples) + 0.5) / float(k_samples) - 0.5;
}
