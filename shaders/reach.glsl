// Which projectors reach a point of the prototype, and how the light is shared among them.
#include "bindings.glsl"
#include "blocks.glsl"

layout(binding = k_projector_ids_unit) uniform usampler2DArray s_projector_ids;
// For each projector: pixels over a grid of tangents.
layout(binding = k_pixel_maps_unit) uniform sampler2DArray s_pixel_maps;
// For each projector, over its image: how much of its light arrives.
layout(binding = k_occlusion_unit) uniform sampler2DArray s_arriving;
// For each projector, over its ids: share of its light kept beside edges and shadows.
layout(binding = k_edge_fade_unit) uniform sampler2DArray s_kept;
uniform int u_projector_count;

// Weight beside shadows, of what is elsewhere: the step where light ends stays below it. Less would hand light over
// within a few pixels where two projectors have shadows.
const float k_least_kept = 0.01;
const float k_least_share = 1e-4;  // at the very border, so that a projector alone there still gives its light

// Pixel of a tangent in a projector's own image.
vec2 pixel_of(Sight projector, vec2 tangent) {
  vec2 node = (tangent - projector.map.xy) * projector.map.zw;
  ivec2 nodes = textureSize(s_pixel_maps, 0).xy;
  ivec2 first = ivec2(floor(node));
  if (any(lessThan(first, ivec2(0))) || any(greaterThan(first, nodes - 2))) return vec2(-1e6);
  int layer = int(projector.quality.z);
  return between(texelFetch(s_pixel_maps, ivec3(first, layer), 0).xy,
                 texelFetch(s_pixel_maps, ivec3(first + ivec2(1, 0), layer), 0).xy,
                 texelFetch(s_pixel_maps, ivec3(first + ivec2(0, 1), layer), 0).xy,
                 texelFetch(s_pixel_maps, ivec3(first + ivec2(1, 1), layer), 0).xy, node - vec2(first));
}

// Gain of a projector's light in its pixel (core/photometric_response.h, Vignetting).
float vignetting(Sight projector, vec2 px) {
  vec2 half_size = 0.5 * projector.size.zw;
  vec2 q = (px + 0.5 - half_size) / length(half_size);
  float q2 = dot(q, q);
  return 1.0 + dot(projector.vignetting.xy, q) + q2 * (projector.vignetting.z + q2 * projector.vignetting.w);
}

// A point of the prototype with two unit normals, of its triangle and of the smooth surface that the mesh stands for, both
// turned to the side that counts.
struct Place {
  vec3 p, d_flat, d_smooth;
};

// Where a ray along d meets the prototype: on its triangle, also where the ray just missed that. The scene's frame is the
// prototype's.
Place place_at(Hit hit, vec3 d) {
  uint first = 3u * (hit.id - 1u);
  vec3 p = mat3(corner(first).xyz, corner(first + 1u).xyz, corner(first + 2u).xyz) * hit.weights;
  Place place = Place(p, flat_normal_in_owner(hit.id), smooth_normal_in_owner(hit));
  if (dot(place.d_flat, d) > 0.0) place.d_flat = -place.d_flat;
  if (dot(place.d_smooth, place.d_flat) < 0.0) place.d_smooth = -place.d_smooth;
  return place;
}

// How much wider a pixel's light lies at a depth than its square, area by area: a square of side 1 has a variance of
// 1 / 12, a disc of diameter d one of d^2 / 16.
float spread(Sight projector, float depth) {
  float disc = (projector.focus.x * depth - projector.focus.y) / depth;  // divided last: drivers divide inexactly
  return 1.0 + 0.75 * disc * disc;
}

// How projector j lights a place.
struct Reach {
  float quality;     // pixels a square metre, fewer where they are out of focus, times the cosine once more against
                     // grazing light, fading towards the image's border, the prototype's edges and its shadows; 0 where
                     // its light does not fall: turned away, outside, in a shadow
  float irradiance;  // of white, where 1 m away and head on is 1 (1/m^2); also where p is outside or in a shadow
  float arriving;    // of its light on the way to p, 0 ... 1: the rest is in somebody's shadow
};

// `is_seen`: it is known that the prototype does not hide the place from it.
Reach reach(int j, Place place, bool is_seen) {
  Sight projector = sight_at(j);
  vec3 to_eye = projector.p_eye.xyz - place.p;
  float distance_2 = dot(to_eye, to_eye);
  vec3 q = (projector.sight_from_scene * vec4(place.p, 1)).xyz;
  if (dot(place.d_flat, to_eye) <= 0.0 || q.z <= 0.0) return Reach(0.0, 0.0, 1.0);
  const float k_least_cosine = 0.01;  // where the smooth surface looks away and its triangle does not
  float cosine = max(k_least_cosine, dot(place.d_smooth, to_eye) * inversesqrt(distance_2));
  vec2 px = pixel_of(projector, q.xy / q.z);
  vec2 last = projector.size.zw - 0.5;
  float gain = vignetting(projector, clamp(px, vec2(-0.5), last));
  Reach reach = Reach(0.0, cosine / distance_2 * max(gain, 0.05), 1.0);
  vec2 inside = min(px + 0.5, last - px);
  float border = min(inside.x, inside.y);
  if (border < 0.0 || (!is_seen && is_hidden(s_projector_ids, projector, place.p))) return reach;
  float soft = smoothstep(0.0, projector.quality.y, border);
  if (u_projector_count > 1) {
    vec2 texel = projector.focal_centre.xy * q.xy / q.z + projector.focal_centre.zw + 0.5;
    float kept = texture(s_kept, vec3(texel / float(k_block) / vec2(textureSize(s_kept, 0).xy), projector.quality.z)).r;
    soft *= mix(k_least_kept, 1.0, kept);
  }
  soft = max(k_least_share, soft);
  reach.arriving = texture(s_arriving, vec3((px + 0.5) / projector.size.zw, projector.quality.z)).r;
  reach.quality = soft * cosine * cosine * projector.quality.x * projector.quality.x / distance_2 / spread(projector, q.z);
  return reach;
}

// Whether projector j's light falls on a place: reach(j, place, false).quality > 0, for less.
bool reaches(int j, Place place) {
  Sight projector = sight_at(j);
  vec3 q = (projector.sight_from_scene * vec4(place.p, 1)).xyz;
  if (dot(place.d_flat, projector.p_eye.xyz - place.p) <= 0.0 || q.z <= 0.0) return false;
  vec2 px = pixel_of(projector, q.xy / q.z);
  vec2 inside = min(px + 0.5, projector.size.zw - 0.5 - px);
  return min(inside.x, inside.y) >= 0.0 && !is_hidden(s_projector_ids, projector, place.p);
}

bool is_reached(Place place) {
  int j = 0;
  bool is_lit = false;
  do {
    is_lit = reaches(j, place);
  } while (!is_lit && ++j < u_projector_count);
  return is_lit;
}

// What projector i is to give at a place that it sees.
struct Share {
  float share;          // of the light there; what arrives of all that reach the place sums to one
  float irradiance;     // as Reach
  float missing_black;  // irradiance that black gives where every projector reaches, and that is missing there
  float blocked_black;  // of it, what would arrive but for somebody's shadow
};

// Where light is blocked others give it, and the blocked projector keeps watch: so little that nothing flashes when the
// shadow goes, enough for a camera to see that it has gone. Where nobody else reaches it goes on. Weights fall by
// powers, so that a change of what arrives is as soft where others hardly reach.
const float k_blocked = 1e-3;   // weight of a blocked projector against others
const float k_watch = 0.07;     // of the light, all that keep watch together
const float k_well_in = 0.25;   // share of the light above which a projector keeps its watch whole

// Weight of a projector against others.
float weight_of(Reach reach) { return reach.quality * pow(k_blocked, 1.0 - reach.arriving); }

Share share_of(int i, Place place) {
  Reach own = reach(i, place, true);
  float weight = weight_of(own), sum = weight, quality = own.quality;
  float own_blocked = 1.0 - own.arriving, blocked = own.quality > 0.0 ? own_blocked : 0.0;
  float black = sight_at(i).quality.w * own.irradiance;
  Share share = Share(0.0, own.irradiance, own.quality > 0.0 ? 0.0 : black, black * blocked);
  int j = i == 0 ? 1 : 0;  // the others
  if (u_projector_count > 1) {
    do {
      Reach reach = reach(j, place, false);
      bool is_reached = reach.quality > 0.0;
      sum += weight_of(reach);
      quality += reach.quality;
      black = sight_at(j).quality.w * reach.irradiance;
      if (is_reached) {
        blocked += 1.0 - reach.arriving;
        share.blocked_black += black * (1.0 - reach.arriving);
      } else {
        share.missing_black += black;
      }
      if (++j == i) ++j;
    } while (j < u_projector_count);
  }
  share.missing_black += share.blocked_black;
  if (sum == 0.0) return share;
  float watch = k_watch * own_blocked / max(1.0, blocked) * min(1.0, own.quality / (k_well_in * quality));
  share.share = max(weight / sum, watch);
  return share;
}

// Light over its own black that the projector gives for black that is missing.
float black_lift(Share share, float missing) {
  return share.share == 0.0 ? 0.0 : share.share * missing / share.irradiance;
}
