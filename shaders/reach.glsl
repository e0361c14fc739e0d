// Which projectors reach a point of the prototype, and how the light is shared among them.

uniform usampler2DArray s_projector_ids;
uniform sampler2DArray s_pixel_maps;  // for each projector: pixels over a grid of tangents
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

// How well projector j lights p, whose triangle has the normal d_normal turned to the side that counts; 0 when it
// does not: p outside its picture, turned away or in the shadow of the prototype. Pixels a square metre, times the
// cosine once more against grazing light, fading towards the picture's border.
float reach(int j, vec3 p, vec3 d_normal) {
  Sight projector = s_sights[j];
  vec3 to_eye = projector.p_eye.xyz - p;
  float distance_2 = dot(to_eye, to_eye);
  float cosine = dot(d_normal, to_eye) * inversesqrt(distance_2);
  if (cosine <= 0.0) return 0.0;
  vec3 q = (projector.sight_from_scene * vec4(p, 1)).xyz;
  if (q.z <= 0.0) return 0.0;
  vec2 px = pixel_of(projector, q.xy / q.z);
  vec2 inside = min(px + 0.5, projector.size.zw - 0.5 - px);
  float border = min(inside.x, inside.y);
  if (border < 0.0 || is_hidden(s_projector_ids, projector, p)) return 0.0;
  float soft = max(k_least_share, smoothstep(0.0, projector.quality.y, border));
  return soft * cosine * cosine * projector.quality.x * projector.quality.x / distance_2;
}

bool is_reached(vec3 p, vec3 d_normal) {
  for (int j = 0; j < u_projector_count; ++j) {
    if (reach(j, p, d_normal) > 0.0) return true;
  }
  return false;
}

// Share of the light at p that projector i gives; the shares of all that reach p sum to one.
float share(int i, vec3 p, vec3 d_normal) {
  float own = 0.0, sum = 0.0;
  for (int j = 0; j < u_projector_count; ++j) {
    float w = reach(j, p, d_normal);
    sum += w;
    if (j == i) own = w;
  }
  return sum > 0.0 ? own / sum : 0.0;
}
