// The colour of caps.
#include "scene.glsl"

#ifdef SECTION
// Share of a strip of this width, centred at `phase`, that lines cover; both in distances of lines.
float line_share(float phase, float width) {
  float from = phase - 0.5 * width, to = phase + 0.5 * width, line = u_hatch.x;
  float covered = (floor(to) - floor(from)) * line + min(fract(to), line) - min(fract(from), line);
  return covered / width;
}

// The colour of the cap of `owner` at p, seen along d, linear light; `footprint` is the side (m) of a pixel's patch
// across d. This function alone says what a cap looks like.
vec3 cap_colour(uint owner, vec3 p, vec3 d, float footprint) {
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
