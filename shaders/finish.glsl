// The paint of the whole prototype in light, below the parts: its finish, and the lines over it.
#include "shading.glsl"

#ifdef FINISH
#include "deviation.glsl"
#include "surface_lines.glsl"

const int k_decal_image = 1, k_pattern_image = 2, k_projected_image = 4;  // bits of Material.second.z; 0: no image

bool has_finish() { return owner_at(0u).metallic_roughness.z > 0.5; }
bool is_finish_for_viewer() { return owner_at(0u).metallic_roughness.w > 0.5; }

// The colour at the prototype's point p; `footprint` is the side (m) of the pixel's patch there.
vec3 finish_colour(Material finish, Hit prototype, vec3 p, float footprint) {
  vec3 colour = finish.colour.rgb;
  int kind = finish.second.z;
  if (kind == 0) return colour;
  vec2 texels = vec2(textureSize(s_colour_maps, 0).xy), uv;
  float lod;
  if ((kind & k_projected_image) != 0) {
    uv = vec2(dot(finish.image_u, vec4(p, 1)), dot(finish.image_v, vec4(p, 1)));
    vec2 texels_per_m = texels * vec2(length(finish.image_u.xyz), length(finish.image_v.xyz));
    lod = max(0.0, log2(footprint * max(texels_per_m.x, texels_per_m.y)));
  } else {
    uv = uv_of(prototype);
    lod = texture_lod(prototype, footprint);
  }
  if ((kind & k_decal_image) != 0 && any(greaterThan(abs(uv - 0.5), vec2(0.5)))) return colour;
  vec4 texel = textureLod(s_colour_maps, vec3(uv.x, 1.0 - uv.y, finish.parameters.x), lod);
  return mix(colour, texel.rgb, texel.a);
}

SurfaceMaterial finish_at(Hit prototype, vec3 p, float footprint) {
  Material finish = s_materials[uint(owner_at(0u).metallic_roughness.z) - 1u];
  vec3 n = smooth_normal(prototype);
  bool is_diffuse = finish.parameters.y == 0.0 && finish.parameters.z == 1.0;
  return SurfaceMaterial(finish_colour(finish, prototype, p, footprint), finish.parameters.y, finish.parameters.z,
                         is_diffuse, 1.0, vec3(0), finish.coat.x, finish.coat.y, n, n, n);
}

vec3 painted_light(Hit prototype, vec3 p, vec3 n_side, vec3 d, float footprint) {
  SurfaceMaterial surface = finish_at(prototype, p, footprint);
  float side = dot(surface.n_smooth, n_side) < 0.0 ? -1.0 : 1.0;
  if (is_finish_for_viewer() && dot(n_side, d) < 0.0) return shaded(turned_to_viewer(surface, side, d), -d);
  return light_on_surface(surface, side * surface.n_smooth);
}

// Its light at p, seen along the ray direction d; n_side is a normal on the side that is seen; d_ray is the
// direction of the imager's own ray. a: 0 where it paints nothing.
vec4 finish_light(Hit prototype, vec3 p, vec3 n_side, vec3 d, vec3 d_ray, float footprint) {
  Material finish = s_materials[uint(owner_at(0u).metallic_roughness.z) - 1u];
  if ((finish.second.z & k_deviation) != 0) return deviation_colour(prototype, p, smooth_normal(prototype), d_ray);
  return vec4(painted_light(prototype, p, n_side, d, footprint), 1);
}

// The lines at p, seen along the ray direction d of the imager that is drawn; n_side as above.
vec4 lines_light(Hit prototype, vec3 p, vec3 n_side, vec3 d, float footprint) {
  uint first = 3u * (prototype.id - 1u);
  vec3 a = corner(first).xyz;
  vec3 d_winding = cross(corner(first + 1u).xyz - a, corner(first + 2u).xyz - a);
  return lines_at(Patch(p, n_side, d, footprint), d_winding);
}

bool is_painted() { return true; }

// For passes that draw several samples in a pixel.
void draw_sharp_lines() { g_line_softness = 0.3; }

// Finish and lines: light, multiplied by the share of the patch that has any, and that share. d_viewer: the ray that
// the finish is seen along; d: that of the imager that is drawn.
vec4 paint_light(Hit prototype, vec3 p, vec3 n_side, vec3 d_viewer, vec3 d, float footprint) {
  vec4 lines = lines_light(prototype, p, n_side, d, footprint);
  if (!has_finish() || lines.a == 1.0) return lines;
  vec4 finish = finish_light(prototype, p, n_side, d_viewer, d, footprint);
  return lines + (1.0 - lines.a) * vec4(finish.a * finish.rgb, finish.a);
}
#else
bool has_finish() { return false; }
bool is_painted() { return false; }
void draw_sharp_lines() {}
vec4 paint_light(Hit prototype, vec3 p, vec3 n_side, vec3 d_viewer, vec3 d, float footprint) { return vec4(0); }
#endif
