// From a part's colour to the light that one projector gives for it. The influence of distance, incidence,
// vignetting and the surface's colour is divided out (projector/compensation.h).
#include "bindings.glsl"

// Compensation::none. Other values: by geometry or, if BY_MEASUREMENT is defined, by measurement.
const int k_uncompensated = 0;
uniform int u_compensation;
uniform float u_level;      // irradiance (1/m^2) on the mean surface that a colour of 1 stands for
uniform bool u_even_black;  // adds the black level of projectors that do not reach a point
uniform mat3 u_mean_mixing;
#ifdef BY_MEASUREMENT
uniform int u_reference_camera;  // index of the reference camera's viewpoint
// Layer 3 i + c: the colour that the camera sees when channel c of projector i gives an irradiance of 1; a is
// 0 where it is unknown. The last layer: the colour without projectors.
layout(binding = k_colour_mixing_unit) uniform sampler2DArray s_mixing;
#endif
layout(binding = k_albedo_unit) uniform sampler2D s_albedo;  // albedo of the prototype divided by its mean

struct Surface {
  mat3 mixing;  // columns: colours seen under red, green and blue light of irradiance 1
  vec3 offset;  // colour seen without projectors
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

// As measured with projector i; where that is unknown, with another projector; else the mean.
Surface surface_at(int i, vec3 p, Hit prototype) {
  Surface surface = Surface(u_mean_mixing, vec3(0));
  Viewpoint reference_camera = viewpoint_at(u_reference_camera);
  vec3 q = (reference_camera.pinhole_from_scene * vec4(p, 1)).xyz;
  if (q.z <= 0.0 || is_hidden(s_projector_ids, reference_camera, p)) return surface;
  vec2 px = pixel_of(reference_camera, q.xy / q.z);
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
  const float k_darkest = 0.02;  // relative to the mean; darker surfaces are not compensated further
  albedo = max(albedo, vec3(k_darkest));
  return Surface(mat3(albedo.r, 0, 0, 0, albedo.g, 0, 0, 0, albedo.b), vec3(0));
}
#endif

// Light above its black level that projector i should give at a place of the prototype, where it has `share`.
// The result is outside 0 to 1 where the projector cannot give it. `colour`.a is 0 where no part is shown.
vec3 balanced(int i, vec4 colour, Share share, Place place, Hit prototype) {
  if (u_compensation == k_uncompensated && !u_even_black) return colour.rgb * share.share;
  if (share.share == 0.0) return vec3(0);
  vec3 light = vec3(0);
  if (colour.a > 0.0) {
    if (u_compensation == k_uncompensated) {
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
