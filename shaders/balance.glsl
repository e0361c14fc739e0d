// From a part's colour to the light that one projector gives for it: distance, incidence and vignetting divided out, and
// what the surface does to light (projector/compensation.h).
#include "bindings.glsl"

const int k_as_it_is = 0;  // else by geometry or, where BY_MEASUREMENT is defined, by measurement
uniform int u_compensation;
uniform float u_level;      // irradiance (1/m^2) that a colour of 1 is to look like on the mean surface
uniform bool u_even_black;  // gives the black light of projectors that do not reach a point
uniform mat3 u_mean_mixing;
#ifdef BY_MEASUREMENT
uniform int u_witness;  // sight of the camera that measured the surface
// Layer 3 i + c: what channel c of projector i gives in the camera at an irradiance of 1, a: 0 where unknown; the last
// one: what is there without projectors.
layout(binding = k_colour_mixing_unit) uniform sampler2DArray s_mixing;
#endif
layout(binding = k_albedo_unit) uniform sampler2D s_albedo;  // of the prototype, over its mean

struct Surface {
  mat3 mixing;  // columns: what red, green and blue light of irradiance 1 look like
  vec3 offset;  // what is there without
};

#ifdef BY_MEASUREMENT
vec4 mixing_at(vec2 px, int layer) {
  ivec2 first = ivec2(floor(px));
  ivec2 last = textureSize(s_mixing, 0).xy - 1;
  if (any(lessThan(first, ivec2(0))) || any(greaterThanEqual(first, last))) return vec4(0);
  vec2 f = px - vec2(first);
  vec4 a = texelFetch(s_mixing, ivec3(first, layer), 0), b = texelFetch(s_mixing, ivec3(first + ivec2(1, 0), layer), 0);
  vec4 c = texelFetch(s_mixing, ivec3(first + ivec2(0, 1), layer), 0);
  vec4 d = texelFetch(s_mixing, ivec3(first + ivec2(1, 1), layer), 0);
  if (min(min(a.a, b.a), min(c.a, d.a)) < 0.5) return vec4(0);
  return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
}

// As measured for projector i or, where that one was not seen there, for another; else the mean.
Surface surface_at(int i, vec3 p, Hit prototype) {
  Surface surface = Surface(u_mean_mixing, vec3(0));
  Sight witness = sight_at(u_witness);
  vec3 q = (witness.sight_from_scene * vec4(p, 1)).xyz;
  if (q.z <= 0.0 || is_hidden(s_projector_ids, witness, p)) return surface;
  vec2 px = pixel_of(witness, q.xy / q.z);
  surface.offset = mixing_at(px, 3 * u_projector_count).rgb;
  for (int k = 0; k < u_projector_count; ++k) {
    int j = (i + k) % u_projector_count;
    vec4 red = mixing_at(px, 3 * j);
    if (red.a == 0.0) continue;
    surface.mixing = mat3(red.rgb, mixing_at(px, 3 * j + 1).rgb, mixing_at(px, 3 * j + 2).rgb);
    break;
  }
  return surface;
}

#else
Surface surface_at(int i, vec3 p, Hit prototype) {
  vec2 uv = uv_of(prototype);
  vec3 albedo = texture(s_albedo, vec2(uv.x, 1.0 - uv.y)).rgb;
  const float k_darkest = 0.02;  // of the mean: what is darker stays dark
  albedo = max(albedo, vec3(k_darkest));
  return Surface(mat3(albedo.r, 0, 0, 0, albedo.g, 0, 0, 0, albedo.b), vec3(0));
}
#endif

// Light over black of projector i at a place of the prototype, its share there; outside 0 ... 1 where it cannot give what
// is wanted. `colour` has a: 0 where nothing is to be shown.
vec3 balanced(int i, vec4 colour, Share share, Place place, Hit prototype) {
  if (u_compensation == k_as_it_is && !u_even_black) return colour.rgb * share.share;
  if (share.share == 0.0) return vec3(0);
  vec3 light = vec3(0);
  if (colour.a > 0.0) {
    if (u_compensation == k_as_it_is) {
      light = colour.rgb * share.share;
    } else {
      Surface surface = surface_at(i, place.p, prototype);
      vec3 wanted = u_level * u_mean_mixing * colour.rgb - surface.offset;
      light = share.share / share.irradiance * (inverse(surface.mixing) * wanted);
    }
  }
  light += black_lift(share, u_even_black ? share.missing_black : share.blocked_black);
  return light;
}
