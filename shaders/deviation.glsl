// The prototype's deviation from its CAD as colours: the layout is that of scene/deviation_layer.h.

const int k_deviation = 8;            // bit of Material.second.z
const uint k_band_words = 21u;        // colours of seven bands in linear light, before the triangles
const uint k_no_deviation = 0xffffu;  // standard deviation of a point where nothing was measured
const float k_micrometre = 1e-6;
const float k_hatch_m = 0.006;        // from one line of the hatching to the next

layout(std430, binding = k_deviation_buffer) readonly buffer Deviation { uint s_deviation[]; };

struct DeviationAt {
  bool is_measured;
  float distance;  // m, positive outside
  float stddev;    // m
};

float distance_of(uint word) { return k_micrometre * float(bitfieldExtract(int(word), 0, 16)); }

// The first of the grid's points in row j of a triangle.
uint row_of(uint j, uint divisions) { return j * (divisions + 1u) - (j * (j - 1u)) / 2u; }

// Interpolates at a hit. The surface that the ray along d really meets lies beside the hit, because it is
// proud of the CAD or shy of it: the value there follows from the slope of the deviation.
DeviationAt deviation_at(Hit hit, vec3 n, vec3 d) {
  uint triangle = k_band_words + 2u * (hit.id - 1u);
  uint first = s_deviation[triangle], divisions = s_deviation[triangle + 1u];
  vec3 weights = max(hit.weights, vec3(0));
  weights /= weights.x + weights.y + weights.z;
  vec2 at = weights.yz * float(divisions);
  uvec2 cell = min(uvec2(at), uvec2(divisions - 1u));
  if (cell.x + cell.y > divisions - 1u) cell.x = divisions - 1u - cell.y;
  vec2 f = clamp(at - vec2(cell), vec2(0), vec2(1));
  bool is_upper = f.x + f.y > 1.0 && cell.x + cell.y < divisions - 1u;
  uint row = first + row_of(cell.y, divisions), above = first + row_of(cell.y + 1u, divisions);
  // The corners of the piece: one, and the ones beside it along the triangle's first and second side.
  uvec3 words = is_upper ? uvec3(s_deviation[above + cell.x + 1u], s_deviation[above + cell.x], s_deviation[row + cell.x + 1u])
                         : uvec3(s_deviation[row + cell.x], s_deviation[row + cell.x + 1u], s_deviation[above + cell.x]);
  uvec3 stddevs = words >> 16;
  if (any(equal(stddevs, uvec3(k_no_deviation)))) return DeviationAt(false, 0.0, 0.0);
  vec2 share = is_upper ? vec2(1.0) - f : f;
  share /= max(1.0, share.x + share.y);
  vec3 three = vec3(1.0 - share.x - share.y, share);
  vec3 distances = vec3(distance_of(words.x), distance_of(words.y), distance_of(words.z));
  float distance = dot(three, distances);
  float along = dot(n, d);
  const float k_least_along = 0.2;  // cosine; more obliquely the slope says too little
  if (abs(along) > k_least_along) {
    uint corner0 = 3u * (hit.id - 1u);
    vec3 a = corner(corner0).xyz;
    vec3 e1 = (corner(corner0 + 1u).xyz - a) / float(divisions), e2 = (corner(corner0 + 2u).xyz - a) / float(divisions);
    vec3 beside = distance * (d - along * n) / along;
    vec3 g = vec3(dot(e1, e1), dot(e1, e2), dot(e2, e2));
    vec2 r = vec2(dot(beside, e1), dot(beside, e2));
    float det = g.x * g.z - g.y * g.y;
    vec2 slope = (distances.yz - distances.x) * (is_upper ? -1.0 : 1.0);
    if (det > 1e-6 * g.x * g.z)
      distance += clamp((slope.x * (r.x * g.z - r.y * g.y) + slope.y * (r.y * g.x - r.x * g.y)) / det,
                        -abs(distance), abs(distance));
  }
  return DeviationAt(true, distance, k_micrometre * dot(three, vec3(stddevs)));
}

vec3 band_colour(float distance, float tolerance) {
  float size = abs(distance) / tolerance;
  int band = size <= 1.0 ? 0 : size <= 2.0 ? 1 : size <= 4.0 ? 2 : 3;
  uint first = uint(3 * (3 + (distance < 0.0 ? -band : band)));
  return uintBitsToFloat(uvec3(s_deviation[first], s_deviation[first + 1u], s_deviation[first + 2u]));
}

// Lines along one diagonal of the two axes that the surface faces least.
bool is_between_hatching(vec3 p, vec3 n) {
  vec3 m = abs(n);
  float s = m.x > m.y && m.x > m.z ? p.y + p.z : m.y > m.z ? p.z + p.x : p.x + p.y;
  return fract(s / (1.41421 * k_hatch_m)) < 0.5;
}

// Its colour at the prototype's point p, which is seen along d; a: 0 where nothing was measured. What is
// uncertain, because two standard deviations exceed the tolerance, is hatched.
vec4 deviation_colour(Hit hit, vec3 p, vec3 n, vec3 d) {
  float tolerance = owner_at(0u).colour.x;
  DeviationAt at = deviation_at(hit, n, d);
  if (!at.is_measured || dot(n, d) >= 0.0) return vec4(0);
  if (2.0 * at.stddev > tolerance && is_between_hatching(p, n)) return vec4(0, 0, 0, 1);
  return vec4(band_colour(at.distance, tolerance), 1);
}
