// Which projectors reach a point of the prototype, and how the light is shared among them.
#include "bindings.glsl"
#include "blocks.glsl"

layout(binding = k_projector_ids_unit) uniform usampler2DArray s_projector_ids;
// For each projector: its pixels over a grid of tangents.
layout(binding = k_pixel_maps_unit) uniform sampler2DArray s_pixel_maps;
// For each projector, over its image: the share of its light that arrives.
layout(binding = k_occlusion_unit) uniform sampler2DArray s_arriving;
// For each projector, over its id image: feathering weight near edges and shadows.
layout(binding = k_edge_fade_unit) uniform sampler2DArray s_edge_fade;
uniform int u_projector_count;

// Smallest feathering weight beside shadows, relative to elsewhere. The remaining step where light ends is
// below it. With a smaller value, light would change between projectors within a few pixels where two of them
// have shadows.
const float k_least_edge_fade = 0.01;
const float k_least_share = 1e-4;  // weight at the image border, so that a projector that is alone there
                                   // still gives its light

// The pixel of a projector's own image for a tangent.
vec2 pixel_of(Viewpoint projector, vec2 tangent) {
  vec2 node = (tangent - projector.map.xy) * projector.map.zw;
  ivec2 nodes = textureSize(s_pixel_maps, 0).xy;
  ivec2 first = ivec2(floor(node));
  if (any(lessThan(first, ivec2(0))) || any(greaterThan(first, nodes - 2))) return vec2(-1e6);
  int layer = int(projector.quality.z);
  return bilinear(texelFetch(s_pixel_maps, ivec3(first, layer), 0).xy,
                 texelFetch(s_pixel_maps, ivec3(first + ivec2(1, 0), layer), 0).xy,
                 texelFetch(s_pixel_maps, ivec3(first + ivec2(0, 1), layer), 0).xy,
                 texelFetch(s_pixel_maps, ivec3(first + ivec2(1, 1), layer), 0).xy, node - vec2(first));
}

// Vignetting gain of a projector's pixel (core/photometric_response.h).
float vignetting(Viewpoint projector, vec2 px) {
  vec2 half_size = 0.5 * projector.size.zw;
  vec2 q = (px + 0.5 - half_size) / length(half_size);
  float q2 = dot(q, q);
  return 1.0 + dot(projector.vignetting.xy, q) + q2 * (projector.vignetting.z + q2 * projector.vignetting.w);
}

// A point of the prototype with two unit normals: of its triangle, and of the smooth surface. Both are turned
// to the visible side.
struct Place {
  vec3 p, d_flat, d_smooth;
};

// The place where a ray along d hits the prototype. The point is on the triangle, even if the ray just missed
// it. The scene's frame is the prototype's.
Place place_at(Hit hit, vec3 d) {
  uint first = 3u * (hit.id - 1u);
  vec3 p = mat3(corner(first).xyz, corner(first + 1u).xyz, corner(first + 2u).xyz) * hit.weights;
  Place place = Place(p, flat_normal_in_owner(hit.id), smooth_normal_in_owner(hit));
  if (dot(place.d_flat, d) > 0.0) place.d_flat = -place.d_flat;
  if (dot(place.d_smooth, place.d_flat) < 0.0) place.d_smooth = -place.d_smooth;
  return place;
}

// Ratio of the area of a defocused pixel at this depth to that of a sharp one. A square of side 1 has a
// variance of 1 / 12, a disc of diameter d one of d^2 / 16.
float spread(Viewpoint projector, float depth) {
  // The division comes last, because drivers divide inexactly.
  float disc = (projector.focus.x * depth - projector.focus.y) / depth;
  return 1.0 + 0.75 * disc * disc;
}

// How projector j lights a place.
struct Illumination {
  float quality;     // pixels for each square metre, fewer where they are out of focus; multiplied by the
                     // cosine a second time to avoid grazing light; fades towards the image's border and near
                     // depth edges; 0 where its light does not fall: turned away, outside the image, in a
                     // shadow
  float irradiance;  // irradiance of white (1/m^2, 1 at normal incidence at 1 m); also set where p is outside
                     // the image or in a shadow
  float arriving;    // share of its light that arrives at p, 0 to 1; a person's shadow takes the rest
};

// `is_visible`: the place is known to be visible from the projector.
Illumination illumination_from(int j, Place place, bool is_visible) {
  Viewpoint projector = viewpoint_at(j);
  vec3 to_projector = projector.p_origin.xyz - place.p;
  float distance_2 = dot(to_projector, to_projector);
  vec3 q = (projector.pinhole_from_scene * vec4(place.p, 1)).xyz;
  if (dot(place.d_flat, to_projector) <= 0.0 || q.z <= 0.0) return Illumination(0.0, 0.0, 1.0);
  const float k_least_cosine = 0.01;  // for a smooth normal that faces away although its triangle does not
  float cosine = max(k_least_cosine, dot(place.d_smooth, to_projector) * inversesqrt(distance_2));
  vec2 px = pixel_of(projector, q.xy / q.z);
  vec2 last = projector.size.zw - 0.5;
  float gain = vignetting(projector, clamp(px, vec2(-0.5), last));
  Illumination illumination = Illumination(0.0, cosine / distance_2 * max(gain, 0.05), 1.0);
  vec2 inside = min(px + 0.5, last - px);
  float border = min(inside.x, inside.y);
  if (border < 0.0 || (!is_visible && is_hidden(s_projector_ids, projector, place.p))) return illumination;
  float soft = smoothstep(0.0, projector.quality.y, border);
  if (u_projector_count > 1) {
    vec2 texel = projector.focal_centre.xy * q.xy / q.z + projector.focal_centre.zw + 0.5;
    vec2 block = texel / float(k_block) / vec2(textureSize(s_edge_fade, 0).xy);
    float kept = texture(s_edge_fade, vec3(block, projector.quality.z)).r;
    soft *= mix(k_least_edge_fade, 1.0, kept);
  }
  soft = max(k_least_share, soft);
  illumination.arriving = texture(s_arriving, vec3((px + 0.5) / projector.size.zw, projector.quality.z)).r;
  illumination.quality =
      soft * cosine * cosine * projector.quality.x * projector.quality.x / distance_2 / spread(projector, q.z);
  return illumination;
}

// Whether projector j's light falls on a place. Cheaper than illumination_from(j, place, false).quality > 0.
bool reaches(int j, Place place) {
  Viewpoint projector = viewpoint_at(j);
  vec3 q = (projector.pinhole_from_scene * vec4(place.p, 1)).xyz;
  if (dot(place.d_flat, projector.p_origin.xyz - place.p) <= 0.0 || q.z <= 0.0) return false;
  vec2 px = pixel_of(projector, q.xy / q.z);
  vec2 inside = min(px + 0.5, projector.size.zw - 0.5 - px);
  return min(inside.x, inside.y) >= 0.0 && !is_hidden(s_projector_ids, projector, place.p);
}

bool is_reached(Place place) {
  int j = 0;
  bool is_found = false;
  do {
    is_found = reaches(j, place);
  } while (!is_found && ++j < u_projector_count);
  return is_found;
}

// The part of the light that projector i gives at a place that it sees.
struct Share {
  float share;          // share of the light there; the arriving shares of all projectors that reach the
                        // place sum to one
  float irradiance;     // as in Illumination
  float missing_black;  // missing irradiance of black levels: from projectors that do not reach the place or
                        // are blocked
  float blocked_black;  // the part of missing_black that a person's shadow blocks
};

// Where light is blocked, other projectors give it. The blocked projector keeps a small probe share: so
// little that nothing flashes when the shadow goes, and enough for a camera to see that the shadow has gone.
// Where no other projector reaches, it gives all its light. Weights fall exponentially with the blocked
// share, so that the transition is equally smooth where others hardly reach.
const float k_blocked = 1e-3;      // weight of a blocked projector against others
const float k_probe_share = 0.07;  // share of the light that all blocked projectors together keep as a probe
// Share of the quality above which a projector keeps its full probe share.
const float k_full_probe_quality = 0.25;

// Blending weight of a projector.
float weight_of(Illumination illumination) {
  return illumination.quality * pow(k_blocked, 1.0 - illumination.arriving);
}

Share share_of(int i, Place place) {
  Illumination own = illumination_from(i, place, true);
  float weight = weight_of(own), sum = weight, quality = own.quality;
  float own_blocked = 1.0 - own.arriving, blocked = own.quality > 0.0 ? own_blocked : 0.0;
  float black = viewpoint_at(i).quality.w * own.irradiance;
  Share share = Share(0.0, own.irradiance, own.quality > 0.0 ? 0.0 : black, black * blocked);
  int j = i == 0 ? 1 : 0;  // the other projectors
  if (u_projector_count > 1) {
    do {
      Illumination illumination = illumination_from(j, place, false);
      bool is_reached = illumination.quality > 0.0;
      sum += weight_of(illumination);
      quality += illumination.quality;
      black = viewpoint_at(j).quality.w * illumination.irradiance;
      if (is_reached) {
        blocked += 1.0 - illumination.arriving;
        share.blocked_black += black * (1.0 - illumination.arriving);
      } else {
        share.missing_black += black;
      }
      if (++j == i) ++j;
    } while (j < u_projector_count);
  }
  share.missing_black += share.blocked_black;
  if (sum == 0.0) return share;
  float probe =
      k_probe_share * own_blocked / max(1.0, blocked) * min(1.0, own.quality / (k_full_probe_quality * quality));
  share.share = max(weight / sum, probe);
  return share;
}

// Light above its own black level with which the projector replaces missing black light.
float black_lift(Share share, float missing) {
  return share.share == 0.0 ? 0.0 : share.share * missing / share.irradiance;
}
