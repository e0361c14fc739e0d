// The material of a part at a hit. The other maps of glTF 2.0 are read only if SURFACE_MAPS is defined,
// because software GL would execute the code even if it is not needed.
#include "bindings.glsl"

struct SurfaceMaterial {
  vec3 base;                // linear
  float metallic, roughness;
  bool is_diffuse;          // purely diffuse
  float occlusion;          // share of soft light that arrives (occlusion map)
  vec3 emitted;             // emitted light
  float coat, coat_roughness;  // clear layer: the share that it covers, and its roughness
  vec3 n_smooth, n, n_coat;  // unit normals in the scene's frame: interpolated, with the normal map, and that of
                             // the clear layer; not yet turned to the viewer
};

// The colour of the mesh's corners, linear light, interpolated. It is read only if VERTEX_COLOURS is defined, as
// with the maps.
vec3 vertex_colour(Hit hit, Material material) {
#ifdef VERTEX_COLOURS
  if (material.more.w == 0) return vec3(1);
  uint first = 3u * (hit.id - 1u) + uint(material.more.z);
  return mat3(normal(first).rgb, normal(first + 1u).rgb, normal(first + 2u).rgb) * clamp(hit.weights, 0.0, 1.0);
#else
  return vec3(1);
#endif
}

// Base colour at a hit; `footprint` is the side (m) of the pixel's patch on the surface.
vec3 base_colour(Hit hit, float footprint) {
  Material material = s_materials[material_of(hit.id)];
  vec4 wanted = owner_at(owner_of(hit.id)).colour;
  vec3 colour = (wanted.a > 0.5 ? wanted.rgb : material.colour.rgb) * vertex_colour(hit, material);
  if (material.parameters.x < 0.0) return colour;
  vec2 uv = uv_of(hit);
  vec3 at = vec3(uv.x, 1.0 - uv.y, material.parameters.x);
  return colour * textureLod(s_colour_maps, at, texture_lod(hit, footprint)).rgb;
}

bool is_unlit(Hit hit) {
  return s_materials[material_of(hit.id)].colour.a > 0.5 &&
         all(lessThan(owner_at(owner_of(hit.id)).metallic_roughness.xy, vec2(0)));
}

#ifdef SURFACE_MAPS
layout(binding = k_surface_maps_unit) uniform sampler2DArray s_maps;

// Bits of Material.second.y, as in projector/gpu_scene.cpp: which textures lie in the second coordinates.
const int k_second_map = 1, k_second_normals = 2, k_second_occlusion = 4, k_second_emission = 8, k_second_coat = 16,
          k_second_coat_roughness = 32, k_second_coat_normals = 64;

// The corners' coordinates, v up, in which the texture of this bit lies.
mat3x2 uvs_of(Hit hit, Material material, int bit) {
#ifdef SECOND_UVS
  uint at = 3u * (hit.id - 1u) + uint(material.second.x);
  if ((material.second.y & bit) != 0) return mat3x2(normal(at).xy, normal(at + 1u).xy, normal(at + 2u).xy);
#endif
  return corner_uvs(hit.id);
}

vec3 map_at(Hit hit, Material material, int bit, float footprint, float layer) {
  mat3x2 uvs = uvs_of(hit, material, bit);
  vec2 uv = uvs * hit.weights;
  float lod = lod_of(vec2(textureSize(s_maps, 0).xy), uvs, hit, footprint);
  return textureLod(s_maps, vec3(uv.x, 1.0 - uv.y, layer), lod).rgb;
}

// The normal n with the map of this bit, in the frame of the hit's owner; `scale` multiplies the map's x and y.
vec3 mapped_normal_in_owner(Hit hit, vec3 n, Material material, int bit, float scale, float footprint, float layer) {
  uint first = 3u * (hit.id - 1u) + uint(material.more.x);
  vec4 tangent = mat3x4(normal(first), normal(first + 1u), normal(first + 2u)) * hit.weights;
  vec3 d_u = normalize(tangent.xyz - dot(tangent.xyz, n) * n);
  vec3 d_v = (tangent.w < 0.0 ? -1.0 : 1.0) * cross(n, d_u);
  vec3 along = (2.0 * map_at(hit, material, bit, footprint, layer) - 1.0) * vec3(scale, scale, 1);
  return normalize(along.x * d_u + along.y * d_v + along.z * n);
}

void read_maps(Hit hit, Material material, float footprint, inout SurfaceMaterial surface) {
  surface.emitted = material.emitted.rgb;
  if (material.emitted.a >= 0.0) {
    mat3x2 uvs = uvs_of(hit, material, k_second_emission);
    vec2 uv = uvs * hit.weights;
    float lod = lod_of(vec2(textureSize(s_colour_maps, 0).xy), uvs, hit, footprint);
    surface.emitted *= textureLod(s_colour_maps, vec3(uv.x, 1.0 - uv.y, material.emitted.a), lod).rgb;
  }
  if (material.maps.x >= 0.0) {
    vec3 map = map_at(hit, material, k_second_map, footprint, material.maps.x);
    surface.occlusion = 1.0 + material.maps.w * (map.r - 1.0);
    surface.roughness *= map.g;
    surface.metallic *= map.b;
    surface.is_diffuse = material.more.y == 0;
  }
#ifdef SECOND_UVS
  if (material.more_maps.z >= 0.0) {
    float red = map_at(hit, material, k_second_occlusion, footprint, material.more_maps.z).r;
    surface.occlusion = 1.0 + material.maps.w * (red - 1.0);
  }
#endif
  if (material.maps.y >= 0.0) {
    vec3 n = mapped_normal_in_owner(hit, smooth_normal_in_owner(hit), material, k_second_normals, material.maps.z,
                                    footprint, material.maps.y);
    surface.n = turned_to_scene(owner_of(hit.id), n);
  }
#ifdef CLEARCOAT
  if (material.more_maps.x >= 0.0)
    surface.coat *= map_at(hit, material, k_second_coat, footprint, material.more_maps.x).r;
  if (material.more_maps.y >= 0.0)
    surface.coat_roughness *= map_at(hit, material, k_second_coat_roughness, footprint, material.more_maps.y).g;
  if (material.coat.w >= 0.0) {
    vec3 n = mapped_normal_in_owner(hit, smooth_normal_in_owner(hit), material, k_second_coat_normals,
                                    material.coat.z, footprint, material.coat.w);
    surface.n_coat = turned_to_scene(owner_of(hit.id), n);
  }
#endif
}
#else
void read_maps(Hit hit, Material material, float footprint, inout SurfaceMaterial surface) {}
#endif

// The surface material of a hit that is not unlit. An override of metalness or roughness applies to the whole
// part and replaces the maps. The clear layer stays as it is.
SurfaceMaterial surface_material_at(Hit hit, float footprint) {
  Material material = s_materials[material_of(hit.id)];
  vec2 wanted = owner_at(owner_of(hit.id)).metallic_roughness.xy;
  vec3 n = smooth_normal(hit);
  SurfaceMaterial surface = SurfaceMaterial(base_colour(hit, footprint), material.parameters.y,
                                            material.parameters.z, true, 1.0, vec3(0), material.coat.x,
                                            material.coat.y, n, n, n);
  read_maps(hit, material, footprint, surface);
  if (wanted.x >= 0.0) surface.metallic = wanted.x;
  if (wanted.y >= 0.0) surface.roughness = wanted.y;
  surface.is_diffuse = surface.is_diffuse && surface.metallic == 0.0 && surface.roughness == 1.0;
  return surface;
}
