// The triangles of the prototype and of every variant, and their poses. All triangles are numbered from 0; an
// id is the number + 1, so that 0 means none. "scene" is the coordinate frame in which rays are cast. Data
// that is read often is in texel buffers: software GL reads them several times faster than storage buffers,
// because it loads the lanes of storage buffers one by one.
#include "bindings.glsl"
#include "cut.glsl"

// 3 for each triangle: p in its owner's frame, u.
layout(binding = k_corners_unit) uniform samplerBuffer s_corners;
layout(binding = k_normals_unit) uniform samplerBuffer s_normals;  // 3 for each triangle: unit normal, v
// 5 for each triangle: owner (0 prototype, slot + 1), material (bit 31: it is of a sheet, a piece that does not close),
// and for each corner the id of the triangle across the opposite side (0 where the mesh ends)
layout(binding = k_triangles_unit) uniform usamplerBuffer s_triangles;

vec4 corner(uint i) { return texelFetch(s_corners, int(i)); }
vec4 normal(uint i) { return texelFetch(s_normals, int(i)); }
uint owner_of(uint id) {
#ifdef SECTION
  if (is_cap(id)) return id - k_first_cap;
#endif
  return texelFetch(s_triangles, int(5u * (id - 1u))).x;
}
const uint k_sheet = 0x80000000u;
uint material_of(uint id) { return texelFetch(s_triangles, int(5u * (id - 1u) + 1u)).x & ~k_sheet; }
bool is_of_sheet(uint id) { return (texelFetch(s_triangles, int(5u * (id - 1u) + 1u)).x & k_sheet) != 0u; }
uint neighbour(uint id, int side) { return texelFetch(s_triangles, int(5u * (id - 1u) + 2u) + side).x; }

struct Material {
  vec4 colour;  // linear light; a: 1 when unlit
  vec4 parameters;  // texture layer (-1 when it has none), metallic, roughness, alpha cutoff
  vec4 emitted; // linear light; a: layer of s_colour_maps that multiplies it, or -1
  vec4 maps;    // layers of s_maps, or -1: occlusion, roughness and metalness (x); normals (y); scale of the
                // normals' x and y (z); strength of the occlusion (w)
  ivec4 more;   // x: offset from a corner's number to its tangent in s_normals (the tangent's w is its
                // handedness); y: 1 when there is a map of roughness and metalness; z: offset to the corner's
                // colour, likewise; w: 1 when corners have colours
  vec4 coat;    // clear layer: its share (0: none), its roughness, scale of its normals' x and y, layer of its
                // normals in s_maps
  vec4 more_maps;  // layers of s_maps, or -1: share of the clear layer (x), its roughness (y), occlusion where
                   // it lies in other coordinates than roughness and metalness (z)
  ivec4 second;  // x: offset to the corner's second texture coordinates, likewise; y: bits k_second_… of the
                 // textures that lie in them; z: of a finish: bits of finish.glsl for its image
  vec4 image_u, image_v;  // of a finish with a projected image: its u and v are the products with (p, 1)
};
layout(std430, binding = k_materials_buffer) readonly buffer Materials { Material s_materials[]; };
// Colour textures, one in each layer; sRGB is decoded on reading.
layout(binding = k_colour_maps_unit) uniform sampler2DArray s_colour_maps;
uniform bool u_has_cut_outs;  // whether any material has an alpha cutoff

struct Owner {
  mat4 owner_from_scene;
  vec4 lower;  // lower bound, owner frame; w: 1 when the part is shown
  vec4 upper;  // upper bound; w: 1 when its mode is surface
  vec4 colour; // override of the materials' colour, linear light, where w is 1
  vec4 metallic_roughness;  // overrides, where not negative; of the prototype z: its finish's material + 1,
                            // or 0; w: 1 when the finish is for the viewer
  vec4 hatch;  // of a part that is cut: its product with (p, 1), scene frame, counts the lines on its cap; else 0
};
layout(binding = k_placements_unit) uniform samplerBuffer s_placements;  // 9 for each owner

mat4 matrix_at(samplerBuffer texels, int first) {
  return mat4(texelFetch(texels, first), texelFetch(texels, first + 1), texelFetch(texels, first + 2),
              texelFetch(texels, first + 3));
}

Owner owner_at(uint owner) {
  int first = 9 * int(owner);
  return Owner(matrix_at(s_placements, first), texelFetch(s_placements, first + 4), texelFetch(s_placements, first + 5),
               texelFetch(s_placements, first + 6), texelFetch(s_placements, first + 7),
               texelFetch(s_placements, first + 8));
}

// A viewpoint: where rays start, with the ids that a pinhole image from there holds: layer 0 the prototype,
// layer 1 the parts. Pixel (0,0) is the centre of the top-left texel.
struct Viewpoint {
  mat4 pinhole_from_scene;
  vec4 focal_centre;  // fx, fy, cx, cy of the pinhole image
  vec4 p_origin;      // position in the scene's frame; w: first layer of its ids
  vec4 size;          // xy: size of the pinhole image; zw: size of the imager's own image
  vec4 map;           // xy: tangents of the first node of the imager's pixel map; zw: nodes per tangent
  vec4 quality;       // focal length of the imager (px), width of the soft border (px), layer of its pixel
                      // map, black level as a share of white
  vec4 vignetting;    // tilt (xy), r2, r4 as in core/photometric_response.h
  vec4 focus;         // the blur disc of a point at depth z has a diameter of |x - y / z| pixels
};
layout(binding = k_viewpoints_unit) uniform samplerBuffer s_viewpoints;  // 11 for each viewpoint

Viewpoint viewpoint_at(int i) {
  int first = 11 * i;
  return Viewpoint(matrix_at(s_viewpoints, first), texelFetch(s_viewpoints, first + 4),
                   texelFetch(s_viewpoints, first + 5), texelFetch(s_viewpoints, first + 6),
                   texelFetch(s_viewpoints, first + 7), texelFetch(s_viewpoints, first + 8),
                   texelFetch(s_viewpoints, first + 9), texelFetch(s_viewpoints, first + 10));
}

struct Hit {
  uint id;       // 0: nothing
  float t;       // distance along the unit direction (m)
  vec3 weights;  // barycentric
  float slack;   // largest rounding error of the weights
};
const Hit k_no_hit = Hit(0u, 1e30, vec3(0), 0.0);

const float k_rounding = 2e-6;     // m; rounding of single precision at some metres; closes cracks between
                                   // neighbouring triangles
const float k_same_place = 1e-4;   // m; hits closer than this are one surface

vec3 to_owner(uint owner, vec3 p) { return (owner_at(owner).owner_from_scene * vec4(p, 1)).xyz; }
vec3 turned_to_owner(uint owner, vec3 d) { return mat3(owner_at(owner).owner_from_scene) * d; }
vec3 turned_to_scene(uint owner, vec3 d) { return d * mat3(owner_at(owner).owner_from_scene); }

#ifdef SECTION
vec4 hatch_of(uint owner) {
  return owner == 0u ? u_prototype_hatch : texelFetch(s_placements, 9 * int(owner) + 8);
}
// Whether the plane removes the point p (scene frame) of the triangle.
bool is_removed(uint id, vec3 p) {
  return height_over_cut(p) > -k_cut_margin && hatch_of(owner_of(id)).xyz != vec3(0);
}
// Where a ray meets the plane, as a hit of this cap.
Hit cap_hit(uint id, vec3 p_origin, vec3 d) {
  Hit hit = Hit(id, -height_over_cut(p_origin) / dot(u_cut.xyz, d), vec3(0), 0.0);
  return hit.t > 0.0 ? hit : k_no_hit;
}
#else
bool is_removed(uint id, vec3 p) { return false; }
#endif

// Intersects the ray from o along w (unit length, both in the frame of the triangle's owner) with the plane
// of a triangle. False when the ray is parallel to it.
bool plane_hit_in_owner(uint id, vec3 o, vec3 w, out Hit hit) {
  uint first = 3u * (id - 1u);
  vec3 a = corner(first).xyz - o;
  vec3 ab = corner(first + 1u).xyz - o - a;
  vec3 ac = corner(first + 2u).xyz - o - a;
  vec3 n = cross(ab, ac);
  float along = dot(n, w);
  hit = k_no_hit;
  if (along == 0.0) return false;
  hit.id = id;
  hit.t = dot(n, a) / along;
  vec3 m = cross(w, a);  // its products with the sides are twice the signed areas seen along the ray
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

// The same for the prototype, whose frame is the scene's.
bool prototype_plane_hit(uint id, vec3 p_origin, vec3 d, out Hit hit) {
  return plane_hit_in_owner(id, p_origin, d, hit);
}

bool is_inside(Hit hit) { return all(greaterThanEqual(hit.weights, vec3(-hit.slack))); }

// Whether a triangle, as seen along w (frame of its owner), is thinner than two texels of the id image, so
// that all texels may miss it.
bool is_thin(uint id, float t, vec3 w, Viewpoint viewpoint) {
  uint first = 3u * (id - 1u);
  vec3 a = corner(first).xyz, b = corner(first + 1u).xyz, c = corner(first + 2u).xyz;
  float side = max(distance(a, b), max(distance(b, c), distance(c, a)));
  float area = abs(dot(cross(b - a, c - a), w));
  return area * viewpoint.focal_centre.x < 2.0 * t * side;
}

// The ids of the four texels around the direction d, the nearest texel first, and their bilinear weights.
uvec4 ids_around(usampler2DArray s_ids, Viewpoint viewpoint, int layer, vec3 d, out vec4 share) {
  share = vec4(1, 0, 0, 0);
  vec3 q = mat3(viewpoint.pinhole_from_scene) * d;
  if (q.z <= 0.0) return uvec4(0);
  vec2 px = viewpoint.focal_centre.xy * q.xy / q.z + viewpoint.focal_centre.zw;
  if (any(lessThan(px, vec2(-1))) || any(greaterThan(px, viewpoint.size.xy))) return uvec4(0);
  ivec2 near = ivec2(floor(px + 0.5));
  ivec2 beside = ivec2(px.x < float(near.x) ? -1 : 1, px.y < float(near.y) ? -1 : 1);
  vec2 f = abs(px - vec2(near));
  share = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
  ivec2 last = ivec2(viewpoint.size.xy) - 1;
  int z = int(viewpoint.p_origin.w) + layer;
  uvec4 ids;
  ids.x = texelFetch(s_ids, ivec3(clamp(near, ivec2(0), last), z), 0).x;
  ids.y = texelFetch(s_ids, ivec3(clamp(near + ivec2(beside.x, 0), ivec2(0), last), z), 0).x;
  ids.z = texelFetch(s_ids, ivec3(clamp(near + ivec2(0, beside.y), ivec2(0), last), z), 0).x;
  ids.w = texelFetch(s_ids, ivec3(clamp(near + beside, ivec2(0), last), z), 0).x;
  return ids;
}

// The same ids without duplicates, with zeros last, so that loops over them end early.
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

// Texture coordinates of a triangle's corners, v up.
mat3x2 corner_uvs(uint id) {
  uint first = 3u * (id - 1u);
  return mat3x2(vec2(corner(first).w, normal(first).w),
                vec2(corner(first + 1u).w, normal(first + 1u).w),
                vec2(corner(first + 2u).w, normal(first + 2u).w));
}

vec2 uv_of(Hit hit) { return corner_uvs(hit.id) * hit.weights; }

// Level of detail of a texture of size `texels` for a pixel that covers a patch with sides of `footprint`
// (m); `uvs` are the texture coordinates of the triangle's corners.
float lod_of(vec2 texels, mat3x2 uvs, Hit hit, float footprint) {
  uint first = 3u * (hit.id - 1u);
  vec3 ab = corner(first + 1u).xyz - corner(first).xyz;
  vec3 ac = corner(first + 2u).xyz - corner(first).xyz;
  vec2 uv_ab = uvs[1] - uvs[0];
  vec2 uv_ac = uvs[2] - uvs[0];
  float texel_area = abs(uv_ab.x * uv_ac.y - uv_ab.y * uv_ac.x) * texels.x * texels.y;
  float area = length(cross(ab, ac));
  return area > 0.0 ? max(0.0, log2(footprint * sqrt(texel_area / area))) : 0.0;
}

float texture_lod(Hit hit, float footprint) {
  return lod_of(vec2(textureSize(s_colour_maps, 0).xy), corner_uvs(hit.id), hit, footprint);
}

// Whether the texture's alpha at the hit is below the material's cutoff; `footprint` is the side (m) of a
// pixel's patch on the surface.
bool is_cut_out(Hit hit, float footprint) {
  if (!u_has_cut_outs) return false;
  vec4 parameters = s_materials[material_of(hit.id)].parameters;
  if (parameters.w <= 0.0) return false;
  vec2 uv = uv_of(hit);
  vec3 at = vec3(uv.x, 1.0 - uv.y, parameters.x);
  return textureLod(s_colour_maps, at, texture_lod(hit, footprint)).a < parameters.w;
}

// Moves the hit of a ray that meets a triangle's plane just outside the triangle (frame of the owner) onto
// the triangle. The distance stays that of the plane, or becomes that of the nearest point of the triangle
// where the plane is too steep to extrapolate.
Hit moved_onto_triangle(Hit hit, vec3 o, vec3 w, Viewpoint viewpoint) {
  hit.weights = max(hit.weights, vec3(0));
  hit.weights /= hit.weights.x + hit.weights.y + hit.weights.z;
  uint first = 3u * (hit.id - 1u);
  vec3 p = mat3(corner(first).xyz, corner(first + 1u).xyz, corner(first + 2u).xyz) * hit.weights;
  float t = dot(p - o, w);
  const float k_steepest = 4.0;  // slope: texels of depth for each texel, 76 degrees
  if (!(abs(hit.t - t) < k_steepest * t / viewpoint.focal_centre.x)) hit.t = t;
  return hit;
}

// The first surface that a ray from the viewpoint hits. It is exact: the triangles in the four id texels
// around the ray are intersected. Triangles thinner than a texel may all be missed; then the texels decide,
// by bilinear coverage. A cap's outline is decided in the same way. Parts may have an alpha cutoff, the prototype has
// none. (Software GL executes branches that no lane takes, and executes a loop once too often if its condition comes first. So rare work
// is a further round of a do-while loop.)
Hit first_hit(usampler2DArray s_ids, Viewpoint viewpoint, int layer, vec3 d) {
  vec4 share;
  uvec4 ids = ids_around(s_ids, viewpoint, layer, d, share);
  Hit best = k_no_hit;
  if (ids == uvec4(0)) return best;
#ifdef SECTION
  // The cap of which the texels show most.
  bvec4 are_caps = greaterThanEqual(ids, uvec4(k_first_cap));
  uint cap = are_caps.x ? ids.x : are_caps.y ? ids.y : are_caps.z ? ids.z : are_caps.w ? ids.w : 0u;
  float cap_share = dot(share, vec4(are_caps));
  bool is_seen = dot(share, vec4(notEqual(ids, uvec4(0)))) >= 0.5;
  ids = mix(ids, uvec4(0), are_caps);
  if (ids == uvec4(0)) return cap_share >= 0.5 ? cap_hit(cap, viewpoint.p_origin.xyz, d) : k_no_hit;
#endif
  uvec4 left = each_once(ids);
  uint nearest = left.x;
  bool is_covered = dot(share, vec4(notEqual(ids, uvec4(0)))) >= 0.5, is_whole = all(notEqual(ids, uvec4(0)));
  bool is_through = false;  // hit a piece below the alpha cutoff
  bool is_retry = false;    // all were missed: the nearest is tried once more
  do {
    vec3 o = viewpoint.p_origin.xyz, w = d;  // in the owner's frame; the prototype's is the scene's
    if (layer != 0) {
      uint owner = owner_of(left.x);
      o = to_owner(owner, o);
      w = turned_to_owner(owner, w);
    }
    Hit hit;
    bool is_met = plane_hit_in_owner(left.x, o, w, hit);
    left = uvec4(left.yzw, 0u);
    if (is_retry) {
      if (!is_met) break;
      hit = moved_onto_triangle(hit, o, w, viewpoint);
      if (is_removed(hit.id, viewpoint.p_origin.xyz + hit.t * d)) break;
      if (hit.t > 0.0 && (is_whole || is_thin(hit.id, hit.t, w, viewpoint))) best = hit;
      break;
    }
    if (is_met && is_inside(hit) && hit.t > 0.0 && hit.t < best.t) {
      if (is_removed(hit.id, viewpoint.p_origin.xyz + hit.t * d))
        is_through = true;
      else if (layer == 1 && is_cut_out(hit, hit.t / viewpoint.focal_centre.x))
        is_through = true;
      else
        best = hit;
    }
    is_retry = left.x == 0u && best.id == 0u && !is_through && is_covered;
    if (is_retry) left.x = nearest;
  } while (left.x != 0u);
#ifdef SECTION
  if (cap != 0u && (cap_share >= 0.5 || (best.id == 0u && is_seen))) {
    Hit hit = cap_hit(cap, viewpoint.p_origin.xyz, d);
    if (hit.t < best.t) best = hit;
  }
#endif
  return best;
}

// Whether the prototype hides p (a point on it) from the viewpoint.
bool is_hidden(usampler2DArray s_ids, Viewpoint viewpoint, vec3 p) {
  vec3 d = p - viewpoint.p_origin.xyz;
  float t = length(d);
  d /= t;
  Hit hit = first_hit(s_ids, viewpoint, 0, d);
  bool exact = hit.id != 0u && all(greaterThan(hit.weights, vec3(0)));
  float texel = t / viewpoint.focal_centre.x;
  float slack = k_same_place + (exact ? 1e-5 * t : 2.0 * texel);
  if (hit.id != 0u && hit.t < t - slack) return true;
  // The ray may also hit another triangle of the texels, or a neighbour of one: at a silhouette of a smooth
  // surface, the last triangles are seen at such a grazing angle that texels miss them. The loop walks from
  // each triangle across its sides towards the ray.
  vec4 share;
  uvec4 left = each_once(ids_around(s_ids, viewpoint, 0, d, share));
  if (left.y == 0u) return false;
  for (int k = 0; k < 4; ++k) {
    if (left[k] == hit.id || left[k] == 0u || dot(corner(3u * (left[k] - 1u)).xyz - p, d) > -2.0 * texel) left[k] = 0u;
  }
  left = each_once(left);
  if (left.x == 0u) return false;
  const int k_most_steps = 6;
  uint id = left.x, from = 0u;
  int step = 0;
  do {
    Hit neighbour_hit;
    uint next = 0u;
    if (prototype_plane_hit(id, viewpoint.p_origin.xyz, d, neighbour_hit)) {
      if (is_inside(neighbour_hit)) {
        if (neighbour_hit.t < t - slack) return true;
      } else {
        vec3 w = neighbour_hit.weights;
        next = neighbour(id, w.x < w.y ? (w.x < w.z ? 0 : 2) : w.y < w.z ? 1 : 2);
        // The walk turned back: the ray passes beside both triangles.
        if (next == from || ++step == k_most_steps) next = 0u;
      }
    }
    from = id;
    id = next;
    if (id == 0u) {
      left = uvec4(left.yzw, 0u);
      id = left.x;
      from = 0u;
      step = 0;
    }
  } while (id != 0u);
  return false;
}

// Unit normal of the triangle itself, frame of its owner.
vec3 flat_normal_in_owner(uint id) {
  uint first = 3u * (id - 1u);
  vec3 a = corner(first).xyz;
  return normalize(cross(corner(first + 1u).xyz - a, corner(first + 2u).xyz - a));
}

// Unit normal interpolated from the corners, frame of its owner.
vec3 smooth_normal_in_owner(Hit hit) {
  uint first = 3u * (hit.id - 1u);
  return normalize(mat3(normal(first).xyz, normal(first + 1u).xyz, normal(first + 2u).xyz) * hit.weights);
}

// The same in the scene's frame.
vec3 flat_normal(uint id) { return turned_to_scene(owner_of(id), flat_normal_in_owner(id)); }
vec3 smooth_normal(Hit hit) { return turned_to_scene(owner_of(hit.id), smooth_normal_in_owner(hit)); }

// -1 if the corners' normals point away from the side of the triangle that a ray along d hits, else 1.
float facing_sign(vec3 n_smooth, Hit hit, vec3 d) {
  vec3 flat_one = flat_normal(hit.id);
  if (dot(flat_one, d) > 0.0) flat_one = -flat_one;
  return dot(n_smooth, flat_one) < 0.0 ? -1.0 : 1.0;
}

// The normal n, turned perpendicular to d if it would face away from the viewer.
vec3 turned_to_viewer(vec3 n, vec3 d) {
  float away = dot(n, d);
  return away > 0.0 ? normalize(n - away * d) : n;
}

// The interpolated normal, turned to the side from which d comes. At a silhouette it is perpendicular to d at
// most.
vec3 facing_normal(Hit hit, vec3 d) {
  vec3 n = smooth_normal(hit);
  return turned_to_viewer(facing_sign(n, hit, d) * n, d);
}
