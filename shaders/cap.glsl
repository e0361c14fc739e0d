// The colour of caps.
#include "scene.glsl"

#ifdef SECTION
// Share of a strip of this width, centred at `phase`, that lines cover; both in distances of lines.
float line_share(float phase, float width) {
  float from = phase - 0.5 * width, to = phase + 0.5 * width, line = u_hatch.x;
  float covered = (floor(to) - floor(from)) * line + min(fract(to), line) - min(fract(from), line);
  return covered / width;
}

#ifdef VOLUMES
layout(binding = k_volumes_unit) uniform sampler3D s_volumes;
// 5 for each owner: three rows whose products with (p, 1), scene frame, are the coordinates in s_volumes; the least
// coordinates, w: 1 / width of the grey window, or 0 without a volume; the greatest coordinates, w: the value that is
// black.
layout(binding = k_volume_places_unit) uniform samplerBuffer s_volume_places;

// The slice of the owner's volume at p, as grey by its window; grey is sRGB. a: 0 without a volume.
vec4 slice_at(uint owner, vec3 p) {
  int first = 5 * int(owner);
  vec4 lower = texelFetch(s_volume_places, first + 3), upper = texelFetch(s_volume_places, first + 4), q = vec4(p, 1);
  if (lower.w == 0.0) return vec4(0);
  vec3 at = vec3(dot(texelFetch(s_volume_places, first), q), dot(texelFetch(s_volume_places, first + 1), q),
                 dot(texelFetch(s_volume_places, first + 2), q));
  float value = textureLod(s_volumes, clamp(at, lower.xyz, upper.xyz), 0.0).r;
  float grey = clamp((value - upper.w) * lower.w, 0.0, 1.0);
  return vec4(vec3(grey <= 0.04045 ? grey / 12.92 : pow((grey + 0.055) / 1.055, 2.4)), 1);
}
#endif

// The colour of the cap of `owner` at p, seen along d, linear light; `footprint` is the side (m) of a pixel's patch
// across d. This function alone says what a cap looks like.
vec3 cap_colour(uint owner, vec3 p, vec3 d, float footprint) {
#ifdef VOLUMES
  vec4 slice = slice_at(owner, p);
  if (slice.a > 0.0) return slice.rgb;
#endif
  vec4 hatch = hatch_of(owner);
  // The change of the phase from pixel to pixel: across d, on the plane.
  vec3 change = hatch.xyz - u_cut.xyz * dot(hatch.xyz, d) / dot(u_cut.xyz, d);
  float width = clamp(footprint * length(change), 1e-4, 1e3);
  // Edges are drawn with several samples, so that lines that are wide enough need little smoothing of their own.
  width *= mix(1.0, 0.4, clamp(0.5 / width - 1.0, 0.0, 1.0));
  float share = line_share(dot(hatch.xyz, p) + hatch.w, width);
  return u_cap_colour * mix(1.0, u_hatch.y, clamp(share, 0.0, 1.0));
}

vec3 cap_light(Hit cap, vec3 p_origin, vec3 d, float footprint) {
  return cap_colour(owner_of(cap.id), p_origin + cap.t * d, d, footprint);
}
#else
vec3 cap_light(Hit cap, vec3 p_origin, vec3 d, float footprint) { return vec3(0); }
#endif
