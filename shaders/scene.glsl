// The triangles of the prototype and of every variant, and where they stand. A triangle's number counts from 0 over
// all of them; an id is the number + 1, so that 0 means none. "scene" is the frame that rays are cast in.

layout(std430, binding = 0) readonly buffer Corners { vec4 s_corners[]; };  // 3 a triangle: p in its owner's frame, u
layout(std430, binding = 1) readonly buffer Normals { vec4 s_normals[]; };  // 3 a triangle: unit normal, v

struct Triangle {
  uint owner;      // 0 prototype, slot + 1
  uint material;
  uint beside[3];  // id of the triangle across the side that lies opposite each corner; 0 where the mesh ends
};
layout(std430, binding = 2) readonly buffer Triangles { Triangle s_triangles[]; };

struct Material {
  vec4 colour;  // linear light; a: 1 when unlit
  vec4 look;    // texture layer (-1 when it has none), metallic, roughness, alpha below which there is nothing
  vec4 emitted; // linear light; a: layer of s_looks that multiplies it, or -1
  vec4 maps;    // layers of s_maps, or -1: of occlusion, roughness and metalness, and of normals; scale of the normals'
                // x and y, strength of the occlusion
  ivec4 more;   // added to the number of a corner: where its tangent is in s_normals (w: handedness); 1 when there is a
                // map of roughness and metalness
};
layout(std430, binding = 3) readonly buffer Materials { Material s_materials[]; };
layout(binding = 1) uniform sampler2DArray s_looks;  // all textures, one a layer, sRGB decoded on reading
uniform bool u_has_cut_outs;  // whether any alpha of s_looks means anything

struct Owner {
  mat4 owner_from_scene;
  vec4 lower;  // of its bounds, owner frame; w: 1 when it is shown
  vec4 upper;  // w: 1 when its mode is surface
  vec4 colour; // linear light, instead of its materials' where w is 1
  vec4 look;   // metallic, roughness, instead of its materials' where not negative
};
layout(std430, binding = 4) readonly buffer Placements { Owner s_placements[]; };

// A place that rays start from, with the ids that a pinhole picture from there holds: layer 0 the prototype, layer 1
// the parts. Pixel (0,0) is the centre of the top-left texel.
struct Sight {
  mat4 sight_from_scene;
  vec4 focal_centre;  // fx, fy, cx, cy of the pinhole picture
  vec4 p_eye;         // scene frame; w: first layer of its ids
  vec4 size;          // of the pinhole picture; zw: of the imager's own picture
  vec4 map;           // tangents of the first node of the imager's pixel map, nodes per tangent
  vec4 quality;       // focal length of the imager (px), width of the soft border (px), layer of its pixel map, light of
                      // black as a share of white
  vec4 vignetting;    // tilt (xy), r2, r4 of core/response.h
  vec4 focus;         // a point's disc at depth z is |x - y / z| pixels wide
};
layout(std430, binding = 5) readonly buffer Sights { Sight s_sights[]; };

struct Hit {
  uint id;       // 0: nothing
  float t;       // metres along the unit direction
  vec3 weights;  // barycentric
  float slack;   // of the weights: what rounding may have moved them by
};
const Hit k_no_hit = Hit(0u, 1e30, vec3(0), 0.0);

const float k_rounding = 2e-6;     // m; of single precision a few metres away, closes cracks between neighbours
const float k_same_place = 1e-4;   // m; nearer than this two hits are one surface

uint owner_of(uint id) { return s_triangles[id - 1u].owner; }

vec3 to_owner(uint owner, vec3 p) { return (s_placements[owner].owner_from_scene * vec4(p, 1)).xyz; }
vec3 turned_to_owner(uint owner, vec3 d) { return mat3(s_placements[owner].owner_from_scene) * d; }
vec3 turned_to_scene(uint owner, vec3 d) { return d * mat3(s_placements[owner].owner_from_scene); }

// Where the ray from o along w (unit length, both in the frame of the triangle's owner) meets the plane of a triangle.
// False when it runs along it.
bool plane_hit_in_owner(uint id, vec3 o, vec3 w, out Hit hit) {
  uint first = 3u * (id - 1u);
  vec3 a = s_corners[first].xyz - o;
  vec3 ab = s_corners[first + 1u].xyz - o - a;
  vec3 ac = s_corners[first + 2u].xyz - o - a;
  vec3 n = cross(ab, ac);
  float along = dot(n, w);
  hit = k_no_hit;
  if (along == 0.0) return false;
  hit.id = id;
  hit.t = dot(n, a) / along;
  vec3 m = cross(w, a);  // twice the signed areas seen from the ray
  hit.weights.y = -dot(m, ac) / along;
  hit.weights.z = dot(m, ab) / along;
  hit.weights.x = 1.0 - hit.weights.y - hit.weights.z;
  hit.slack = 1e-6 + k_rounding * inversesqrt(length(n));
  return true;
}

// The same in the scene's frame.
bool plane_hit(uint id, vec3 p_origin, vec3 d, out Hit hit) {
  uint owner = owner_of(id);
  return plane_hit_in_owner(id, to_owner(owner, p_origin), turned_to_owner(owner, d), hit);
}

// The same of the prototype, whose frame is the scene's.
bool prototype_plane_hit(uint id, vec3 p_origin, vec3 d, out Hit hit) {
  return plane_hit_in_owner(id, p_origin, d, hit);
}

bool is_inside(Hit hit) { return all(greaterThanEqual(hit.weights, vec3(-hit.slack))); }

// Whether a triangle, as seen along d, is thinner than two texels of the sight: then texels can miss it.
bool is_thin(uint id, float t, vec3 d, Sight sight) {
  uint first = 3u * (id - 1u);
  vec3 a = s_corners[first].xyz, b = s_corners[first + 1u].xyz, c = s_corners[first + 2u].xyz;
  float side = max(distance(a, b), max(distance(b, c), distance(c, a)));
  float area = abs(dot(cross(b - a, c - a), turned_to_owner(owner_of(id), d)));
  return area * sight.focal_centre.x < 2.0 * t * side;
}

// Texels around the direction d: ids, the nearest first, and their bilinear weights.
uvec4 ids_around(usampler2DArray s_ids, Sight sight, int layer, vec3 d, out vec4 share) {
  share = vec4(1, 0, 0, 0);
  vec3 q = mat3(sight.sight_from_scene) * d;
  if (q.z <= 0.0) return uvec4(0);
  vec2 px = sight.focal_centre.xy * q.xy / q.z + sight.focal_centre.zw;
  if (any(lessThan(px, vec2(-1))) || any(greaterThan(px, sight.size.xy))) return uvec4(0);
  ivec2 near = ivec2(floor(px + 0.5));
  ivec2 beside = ivec2(px.x < float(near.x) ? -1 : 1, px.y < float(near.y) ? -1 : 1);
  vec2 f = abs(px - vec2(near));
  share = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
  ivec2 last = ivec2(sight.size.xy) - 1;
  int z = int(sight.p_eye.w) + layer;
  uvec4 ids;
  ids.x = texelFetch(s_ids, ivec3(clamp(near, ivec2(0), last), z), 0).x;
  ids.y = texelFetch(s_ids, ivec3(clamp(near + ivec2(beside.x, 0), ivec2(0), last), z), 0).x;
  ids.z = texelFetch(s_ids, ivec3(clamp(near + ivec2(0, beside.y), ivec2(0), last), z), 0).x;
  ids.w = texelFetch(s_ids, ivec3(clamp(near + beside, ivec2(0), last), z), 0).x;
  return ids;
}

// The same ids, each once, those that are none last: loops over them end early.
uvec4 each_once(uvec4 ids) {
  if (ids.y == ids.x) ids.y = 0u;
  if (ids.z == ids.x || ids.z == ids.y) ids.z = 0u;
  if (ids.w == ids.x || ids.w == ids.y || ids.w == ids.z) ids.w = 0u;
  for (int k = 0; k < 3; ++k) {
    if (ids.x == 0u) ids = ids.yzwx;
    if (ids.y == 0u) ids = ids.xzwy;
    if (ids.z == 0u) ids = ids.xywz;
  }
  return ids;
}

// Texture coordinates, v up.
vec2 uv_of(Hit hit) {
  uint first = 3u * (hit.id - 1u);
  return mat3x2(vec2(s_corners[first].w, s_normals[first].w),
                vec2(s_corners[first + 1u].w, s_normals[first + 1u].w),
                vec2(s_corners[first + 2u].w, s_normals[first + 2u].w)) * hit.weights;
}

// Level of detail of a texture of so many texels whose pixel covers a patch with sides of `footprint` (m).
float lod_of(vec2 texels, Hit hit, float footprint) {
  uint first = 3u * (hit.id - 1u);
  vec3 ab = s_corners[first + 1u].xyz - s_corners[first].xyz;
  vec3 ac = s_corners[first + 2u].xyz - s_corners[first].xyz;
  vec2 uv = vec2(s_corners[first].w, s_normals[first].w);
  vec2 uv_ab = vec2(s_corners[first + 1u].w, s_normals[first + 1u].w) - uv;
  vec2 uv_ac = vec2(s_corners[first + 2u].w, s_normals[first + 2u].w) - uv;
  float texel_area = abs(uv_ab.x * uv_ac.y - uv_ab.y * uv_ac.x) * texels.x * texels.y;
  float area = length(cross(ab, ac));
  return area > 0.0 ? max(0.0, log2(footprint * sqrt(texel_area / area))) : 0.0;
}

float texture_lod(Hit hit, float footprint) { return lod_of(vec2(textureSize(s_looks, 0).xy), hit, footprint); }

// Whether the material of what is hit has nothing there; `footprint` is the side (m) of a pixel's patch on the surface.
bool is_cut_out(Hit hit, float footprint) {
  if (!u_has_cut_outs) return false;
  vec4 look = s_materials[s_triangles[hit.id - 1u].material].look;
  if (look.w <= 0.0) return false;
  vec2 uv = uv_of(hit);
  return textureLod(s_looks, vec3(uv.x, 1.0 - uv.y, look.x), texture_lod(hit, footprint)).a < look.w;
}

// Where the ray meets a triangle that it just misses: its plane, or its nearest point where the plane is too steep
// to be trusted beyond its triangle.
Hit beside_hit(uint id, vec3 p_origin, vec3 d, Sight sight) {
  Hit hit;
  if (!plane_hit(id, p_origin, d, hit)) return k_no_hit;
  hit.weights = max(hit.weights, vec3(0));
  hit.weights /= hit.weights.x + hit.weights.y + hit.weights.z;
  uint first = 3u * (id - 1u);
  vec3 p = mat3(s_corners[first].xyz, s_corners[first + 1u].xyz, s_corners[first + 2u].xyz) * hit.weights;
  uint owner = owner_of(id);
  float t = dot(p - to_owner(owner, p_origin), turned_to_owner(owner, d));
  const float k_steepest = 4.0;  // texels of depth a texel, 76 degrees
  if (!(abs(hit.t - t) < k_steepest * t / sight.focal_centre.x)) hit.t = t;
  return hit;
}

// First surface that the ray from the sight's eye meets: exactly, by intersecting the triangles that the texels
// around it saw. Triangles thinner than texels can all be missed: then the texels decide, by bilinear coverage. Parts
// may have pieces cut out, the prototype has none.
Hit first_hit(usampler2DArray s_ids, Sight sight, int layer, vec3 d) {
  vec4 share;
  uvec4 ids = ids_around(s_ids, sight, layer, d, share);
  Hit best = k_no_hit;
  if (ids == uvec4(0)) return best;
  bool is_through = false;  // what is cut out
  for (uvec4 left = each_once(ids); left.x != 0u; left = uvec4(left.yzw, 0u)) {
    Hit hit;
    bool is_met = layer == 0 ? prototype_plane_hit(left.x, sight.p_eye.xyz, d, hit) : plane_hit(left.x, sight.p_eye.xyz, d, hit);
    if (!is_met || !is_inside(hit) || hit.t <= 0.0 || hit.t >= best.t) continue;
    if (layer == 1 && is_cut_out(hit, hit.t / sight.focal_centre.x))
      is_through = true;
    else
      best = hit;
  }
  if (best.id != 0u || is_through) return best;
  float cover = dot(share, vec4(notEqual(ids, uvec4(0))));
  if (cover < 0.5) return best;
  uint id = ids.x != 0u ? ids.x : ids.y != 0u ? ids.y : ids.z != 0u ? ids.z : ids.w;
  Hit hit = beside_hit(id, sight.p_eye.xyz, d, sight);
  if (hit.t <= 0.0 || (any(equal(ids, uvec4(0))) && !is_thin(id, hit.t, d, sight))) return best;
  return hit;
}

// Whether a ray meets the prototype nearer than t in or beside a triangle that a texel saw: where a smooth surface turns
// away its last triangles are seen so much aslant that texels miss them.
bool is_met_beside(uint id, vec3 p_origin, vec3 d, float t) {
  const int k_most_steps = 6;
  uint from = 0u;
  for (int i = 0; i < k_most_steps && id != 0u; ++i) {
    Hit hit;
    if (!prototype_plane_hit(id, p_origin, d, hit)) return false;
    if (is_inside(hit)) return hit.t < t;
    int side = hit.weights.x < hit.weights.y ? (hit.weights.x < hit.weights.z ? 0 : 2) : hit.weights.y < hit.weights.z ? 1 : 2;
    uint next = s_triangles[id - 1u].beside[side];
    if (next == from) return false;  // folded back: the ray passes beside both
    from = id;
    id = next;
  }
  return false;
}

// Whether the prototype hides p (a point on it) from the sight's eye.
bool is_hidden(usampler2DArray s_ids, Sight sight, vec3 p) {
  vec3 d = p - sight.p_eye.xyz;
  float t = length(d);
  d /= t;
  Hit hit = first_hit(s_ids, sight, 0, d);
  bool exact = hit.id != 0u && all(greaterThan(hit.weights, vec3(0)));
  float texel = t / sight.focal_centre.x;
  float slack = k_same_place + (exact ? 1e-5 * t : 2.0 * texel);
  if (hit.id != 0u && hit.t < t - slack) return true;
  vec4 share;
  uvec4 left = each_once(ids_around(s_ids, sight, 0, d, share));
  if (left.y == 0u) return false;
  for (; left.x != 0u; left = uvec4(left.yzw, 0u)) {
    if (left.x == hit.id || dot(s_corners[3u * (left.x - 1u)].xyz - p, d) > -2.0 * texel) continue;
    if (is_met_beside(left.x, sight.p_eye.xyz, d, t - slack)) return true;
  }
  return false;
}

// Unit normal of the triangle itself, frame of its owner.
vec3 flat_normal_in_owner(uint id) {
  uint first = 3u * (id - 1u);
  vec3 a = s_corners[first].xyz;
  return normalize(cross(s_corners[first + 1u].xyz - a, s_corners[first + 2u].xyz - a));
}

// Unit normal interpolated from the corners, frame of its owner.
vec3 smooth_normal_in_owner(Hit hit) {
  uint first = 3u * (hit.id - 1u);
  return normalize(mat3(s_normals[first].xyz, s_normals[first + 1u].xyz, s_normals[first + 2u].xyz) * hit.weights);
}

// The same in the scene's frame.
vec3 flat_normal(uint id) { return turned_to_scene(owner_of(id), flat_normal_in_owner(id)); }
vec3 smooth_normal(Hit hit) { return turned_to_scene(owner_of(hit.id), smooth_normal_in_owner(hit)); }

// -1 where d comes from behind the corners' normals, as the triangle is turned, else 1.
float side_seen(vec3 n_smooth, Hit hit, vec3 d) {
  vec3 flat_one = flat_normal(hit.id);
  if (dot(flat_one, d) > 0.0) flat_one = -flat_one;
  return dot(n_smooth, flat_one) < 0.0 ? -1.0 : 1.0;
}

// A normal that looks aside where it would look along d.
vec3 not_away(vec3 n, vec3 d) {
  float away = dot(n, d);
  return away > 0.0 ? normalize(n - away * d) : n;
}

// The interpolated normal turned to where d comes from, as its triangle is; at a silhouette it looks aside, not away.
vec3 facing_normal(Hit hit, vec3 d) {
  vec3 n = smooth_normal(hit);
  return not_away(side_seen(n, hit, d) * n, d);
}
