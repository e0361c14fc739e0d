// Lines of light on the prototype (projector/surface_lines.h), anti-aliased over the pixel's patch of surface.

// Texel 0: number of repeated lines, number of buckets, side of a cell (m), first texel of the buckets. Texel 1:
// first texels of the entries and of the segments. From texel 2: the repeated lines, 4 texels for each.
layout(binding = k_lines_unit) uniform samplerBuffer s_lines;
const int k_line_header = 2, k_repeated_texels = 4, k_segment_texels = 4;
const float k_stripes = 0.0, k_grid = 1.0, k_dots = 2.0;  // as RepeatedLines::Form

// The patch of surface that a pixel sees.
struct Patch {
  vec3 p;
  vec3 d_normal;    // of the triangle, towards the imager
  vec3 d;           // ray from the imager
  float footprint;  // side of a square patch that faces the imager (m)
};

// Width of the patch along the unit tangent g. Capped, so that segments are found within the reach of their cells.
float patch_width(Patch patch_, vec3 g) {
  const float k_widest = 0.003;  // m; as k_most_blur in projector/surface_lines.cpp
  float slope = dot(patch_.d, g) / max(0.05, abs(dot(patch_.d, patch_.d_normal)));
  return min(patch_.footprint * sqrt(1.0 + slope * slope), k_widest);
}

// Softness of a line's edges as a share of the patch's width: less where several samples are drawn in a pixel.
float g_line_softness = 1.0;

// Share of the patch that is covered by a line at a distance (m), which is at least as wide as the patch.
float line_share(float distance_, float half_width, float width) {
  return clamp((max(half_width, 0.5 * width) - distance_) / (g_line_softness * width) + 0.5, 0.0, 1.0);
}

// Distance along the surface from the nearest multiple of the spacing, and the direction there.
float stripe_distance(Patch patch_, vec3 axis, float at, float spacing, out vec3 g) {
  vec3 along = axis - patch_.d_normal * dot(patch_.d_normal, axis);
  float slope = max(length(along), 1e-3);
  g = along / slope;
  return abs(at - spacing * round(at / spacing)) / slope;
}

float repeated_share(int first, Patch patch_) {
  vec4 row_u = texelFetch(s_lines, first), row_v = texelFetch(s_lines, first + 1),
       area = texelFetch(s_lines, first + 2);
  float half_width = texelFetch(s_lines, first + 3).a;
  vec2 at = vec2(dot(row_u, vec4(patch_.p, 1)), dot(row_v, vec4(patch_.p, 1)));
  if (any(greaterThan(abs(at), area.xy + half_width))) return 0.0;
  vec3 g_u, g_v;
  float from_u = stripe_distance(patch_, row_u.xyz, at.x, area.z, g_u);
  if (area.w == k_stripes) return line_share(from_u, half_width, patch_width(patch_, g_u));
  float from_v = stripe_distance(patch_, row_v.xyz, at.y, area.z, g_v);
  if (area.w == k_grid)
    return max(line_share(from_u, half_width, patch_width(patch_, g_u)),
               line_share(from_v, half_width, patch_width(patch_, g_v)));
  return line_share(length(vec2(from_u, from_v)), half_width,
                    0.5 * (patch_width(patch_, g_u) + patch_width(patch_, g_v)));
}

// As bucket_of in projector/surface_lines.cpp.
int line_bucket(vec3 p, float cell, int buckets) {
  uvec3 at = uvec3(ivec3(floor(p / cell)));
  return int((at.x * 73856093u ^ at.y * 19349663u ^ at.z * 83492791u) % uint(buckets));
}

float line_number(int first, int i) { return texelFetch(s_lines, first + i / 4)[i % 4]; }

// The share of a segment; 0 on the other side of a thin shell.
float segment_share(int first, Patch patch_, vec3 d_winding) {
  vec4 a = texelFetch(s_lines, first), b = texelFetch(s_lines, first + 1);
  vec3 n = texelFetch(s_lines, first + 2).xyz, ab = b.xyz - a.xyz;
  if (dot(n, d_winding) < 0.0) return 0.0;
  float along = clamp(dot(patch_.p - a.xyz, ab) / dot(ab, ab), 0.0, 1.0);
  vec3 g = cross(patch_.d_normal, ab);
  float size = length(g);
  float width = size > 0.0 ? patch_width(patch_, g / size) : patch_.footprint;
  return line_share(distance(patch_.p, a.xyz + along * ab), a.w, width);
}

// Light of the lines, multiplied by their share of the patch, and that share. d_winding: the normal of the
// triangle as it winds.
vec4 lines_at(Patch patch_, vec3 d_winding) {
  vec4 head = texelFetch(s_lines, 0);
  vec4 light = vec4(0);
  for (int i = 0; i < int(head.x); ++i) {
    int first = k_line_header + k_repeated_texels * i;
    light = mix(light, vec4(texelFetch(s_lines, first + 3).rgb, 1), repeated_share(first, patch_));
  }
  int buckets = int(head.y);
  if (buckets == 0) return light;
  vec4 places = texelFetch(s_lines, 1);
  int bucket = line_bucket(patch_.p, head.z, buckets), first_bucket = int(head.w);
  int at = int(line_number(first_bucket, bucket)), end = int(line_number(first_bucket, bucket + 1));
  float best = 0.0;
  int of_best = 0;
  for (; at < end; ++at) {
    int segment = int(places.y) + k_segment_texels * int(line_number(int(places.x), at));
    float share = segment_share(segment, patch_, d_winding);
    if (share >= best) of_best = segment;
    best = max(best, share);
  }
  if (best == 0.0) return light;
  return mix(light, vec4(texelFetch(s_lines, of_best + 3).rgb, 1), best);
}
