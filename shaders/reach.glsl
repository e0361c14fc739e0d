// Which projectors reach a point of the prototype, and how the light is shared among them.

uniform usampler2DArray s_projector_ids;
uniform sampler2DArray s_pixel_maps;  // for each projector: pixels over a grid of tangents
uniform sampler2DArray s_arriving;    // for each projector, over its picture: how much of its light arrives
uniform int u_projector_count;

const float k_least_share = 1e-4;  // at the very border, so that a projector alone there still gives its light

// Pixel of a tangent in a projector's own picture.
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

// Gain of a projector's light in its pixel (core/response.h, Vignetting).
float vignetting(Sight projector, vec2 px) {
  vec2 half_size = 0.5 * projector.size.zw;
  vec2 q = (px + 0.5 - half_size) / length(half_size);
  float q2 = dot(q, q);
  return 1.0 + dot(projector.vignetting.xy, q) + q2 * (projector.vignetting.z + q2 * projector.vignetting.w);
}

// How projector j lights p, whose triangle has the normal d_normal turned to the side that counts.
struct Reach {
  float quality;     // pixels a square metre, times the cosine once more against grazing light, fading towards the
                     // picture's border; 0 where its light does not fall on p: turned away, outside, in a shadow
  float irradiance;  // of white, where 1 m away and head on is 1 (1/m^2); also where p is outside or in a shadow
  float arriving;    // of its light on the way to p, 0 ... 1: the rest is in somebody's shadow
};

Reach reach(int j, vec3 p, vec3 d_normal) {
  Sight projector = s_sights[j];
  vec3 to_eye = projector.p_eye.xyz - p;
  float distance_2 = dot(to_eye, to_eye);
  float cosine = dot(d_normal, to_eye) * inversesqrt(distance_2);
  vec3 q = (projector.sight_from_scene * vec4(p, 1)).xyz;
  if (cosine <= 0.0 || q.z <= 0.0) return Reach(0.0, 0.0, 1.0);
  vec2 px = pixel_of(projector, q.xy / q.z);
  vec2 last = projector.size.zw - 0.5;
  float gain = vignetting(projector, clamp(px, vec2(-0.5), last));
  Reach reach = Reach(0.0, cosine / distance_2 * max(gain, 0.05), 1.0);
  vec2 inside = min(px + 0.5, last - px);
  float border = min(inside.x, inside.y);
  if (border < 0.0 || is_hidden(s_projector_ids, projector, p)) return reach;
  float soft = max(k_least_share, smoothstep(0.0, projector.quality.y, border));
  reach.arriving = texture(s_arriving, vec3((px + 0.5) / projector.size.zw, projector.quality.z)).r;
  reach.quality = soft * cosine * cosine * projector.quality.x * projector.quality.x / distance_2;
  return reach;
}

bool is_reached(vec3 p, vec3 d_normal) {
  for (int j = 0; j < u_projector_count; ++j) {
    if (reach(j, p, d_normal).quality > 0.0) return true;
  }
  return false;
}

// What projector i is to give at p.
struct Share {
  float share;          // of the light there; what arrives of all that reach p sums to one
  float irradiance;     // as Reach
  float missing_black;  // irradiance that black gives where every projector reaches, and that is missing at p
  float blocked_black;  // of it, what would arrive but for somebody's shadow
};

// Where light is blocked others give it, and the blocked projector keeps watch: so little that nothing flashes when the
// shadow goes, enough for a camera to see that it has gone. Where nobody else reaches it goes on. Weights fall by
// powers, so that a change of what arrives is as soft where others hardly reach.
const float k_blocked = 1e-3;   // weight of a blocked projector against others
const float k_watch = 0.07;     // of the light, all that keep watch together
const float k_well_in = 0.25;   // share of the light above which a projector keeps its watch whole

Share share_of(int i, vec3 p, vec3 d_normal) {
  float own = 0.0, sum = 0.0, own_quality = 0.0, quality = 0.0, own_blocked = 0.0, blocked = 0.0;
  Share share = Share(0.0, 0.0, 0.0, 0.0);
  for (int j = 0; j < u_projector_count; ++j) {
    Reach reach = reach(j, p, d_normal);
    bool is_reached = reach.quality > 0.0;
    float weight = reach.quality * pow(k_blocked, 1.0 - reach.arriving);
    sum += weight;
    quality += reach.quality;
    if (is_reached) blocked += 1.0 - reach.arriving;
    float black = s_sights[j].quality.w * reach.irradiance;
    if (is_reached) share.blocked_black += black * (1.0 - reach.arriving);
    if (!is_reached) share.missing_black += black;
    if (j != i) continue;
    own = weight;
    own_quality = reach.quality;
    own_blocked = 1.0 - reach.arriving;
    share.irradiance = reach.irradiance;
  }
  share.missing_black += share.blocked_black;
  if (sum == 0.0) return share;
  float watch = k_watch * own_blocked / max(1.0, blocked) * min(1.0, own_quality / (k_well_in * quality));
  share.share = max(own / sum, watch);
  return share;
}

// Light over its own black that the projector gives for black that is missing.
float black_lift(Share share, float missing) {
  return share.share == 0.0 ? 0.0 : share.share * missing / share.irradiance;
}
