// Shading of a part's surface, in linear light.
#include "bindings.glsl"
#include "material.glsl"
#include "cap.glsl"

// The room light, for materials that are not unlit: hemispherical soft light around an up direction, and
// distant lamps. Directions are in the scene's frame; the light values are those reflected by a white surface
// that faces the light.
const int k_most_lamps = 4;
uniform vec4 u_d_up, u_soft_below, u_soft_above;
uniform vec4 u_d_lamps[k_most_lamps], u_lamps[k_most_lamps];
uniform int u_lamp_count;
uniform bool u_has_room_light;  // else the light moves with the viewer

// Soft light of which the share `above` comes from above.
vec3 soft_light(float above) { return mix(u_soft_below.rgb, u_soft_above.rgb, above); }

#ifdef ROOM_IMAGE
// The picture of the room of projector/room_image_levels.h; its third coordinate is the level. Its frame: right,
// up, ahead.
layout(binding = k_room_image_unit) uniform sampler3D s_room_image;
uniform mat3 u_image_from_scene;
uniform float u_image_strength;
const float k_roughness_levels = 9.0, k_diffuse_level = k_roughness_levels, k_levels = k_roughness_levels + 1.0;

vec3 image_light(vec3 d_scene, float level) {
  const float k_pi = 3.14159265358979;
  vec3 d = u_image_from_scene * d_scene;
  vec2 level_d = abs(d.x) + abs(d.z) < 1e-6 ? vec2(0, 1) : d.xz;  // right above or below, any column will do
  vec2 uv = vec2(0.5 + atan(level_d.x, level_d.y) / (2.0 * k_pi), acos(clamp(d.y, -1.0, 1.0)) / k_pi);
  return u_image_strength * textureLod(s_room_image, vec3(uv, (level + 0.5) / k_levels), 0.0).rgb;
}
vec3 diffuse_image_light(vec3 n) { return image_light(n, k_diffuse_level); }
vec3 glossy_image_light(vec3 d, float roughness) {
  return image_light(d, (k_roughness_levels - 1.0) * pow(roughness, 2.0 / 3.0));
}
#else
vec3 diffuse_image_light(vec3 n) { return vec3(0); }
vec3 glossy_image_light(vec3 d, float roughness) { return vec3(0); }
#endif

// Soft light and the picture of the room, reflected by a white diffuse surface.
vec3 diffuse_soft_light(vec3 n) { return soft_light(0.5 + 0.5 * dot(n, u_d_up.xyz)) + diffuse_image_light(n); }

// Light reflected by a white diffuse surface.
vec3 diffuse_light(vec3 n) {
  vec3 light = diffuse_soft_light(n);
  for (int i = 0; i < u_lamp_count; ++i) light += u_lamps[i].rgb * max(0.0, dot(n, u_d_lamps[i].xyz));
  return light;
}

// The table of projector/brdf_lut.h. Indexed by cosine and roughness: factors of the colour at normal
// incidence (red) and of white (green), and where most of the reflected light comes from, between the normal
// (0) and the mirror direction (1) (alpha). Indexed by height (-1 to 1) and roughness: the share of the
// reflected light that comes from above (blue).
layout(binding = k_brdf_lut_unit) uniform sampler2D s_brdf_lut;

vec4 brdf_lut_at(float x, float roughness) {
  const float k_nodes = 32.0;
  return textureLod(s_brdf_lut, (vec2(x, roughness) * (k_nodes - 1.0) + 0.5) / k_nodes, 0.0);
}

vec3 specular_soft_light(vec3 f0, float roughness, vec3 n, vec3 d_view) {
  vec4 share = brdf_lut_at(max(0.0, dot(n, d_view)), roughness);
  vec3 d = normalize(mix(n, reflect(-d_view, n), share.a));
  float above = brdf_lut_at(0.5 + 0.5 * dot(d, u_d_up.xyz), roughness).b;
  return (soft_light(above) + glossy_image_light(d, roughness)) * (f0 * share.r + share.g);
}

// Light of a lamp reflected by a surface with a diffuse colour and a reflectance at normal incidence
// (`f0`): GGX with Smith's shadowing, layers mixed by the Fresnel term (glTF 2.0, appendix B; Walter et al.
// 2007). With `specular` 0 it is purely diffuse. A branch is avoided, because software GL would execute both
// sides.
vec3 lamp_reflection(vec3 diffuse, vec3 f0, float specular, float roughness, vec3 n, vec3 d_view, vec3 d_lamp) {
  const float k_smoothest = 0.2;  // smallest roughness for lamps, because real lamps have a size
  float r = max(roughness, k_smoothest), a2 = r * r * r * r;
  vec3 h = d_view + d_lamp;
  h *= inversesqrt(max(1e-12, dot(h, h)));  // the limit matters where both directions are opposite
  float nl = max(0.0, dot(n, d_lamp)), nv = max(1e-3, dot(n, d_view)), nh = dot(n, h);
  float peak = nh * nh * (a2 - 1.0) + 1.0;
  float visible = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
  float x = 1.0 - max(0.0, dot(d_view, h)), grazing = x * x * x * x * x;
  vec3 fresnel = specular * (f0 + (1.0 - f0) * grazing);
  // The factors pi of the lamp and 1 / pi of the surface cancel.
  return nl * ((1.0 - fresnel) * diffuse + a2 / (peak * peak) * 0.5 / visible * fresnel);
}

// The clear layer over the colour of what is below it: GGX with roughness of its own, and Schlick's term for glass
// at the angle of the view (glTF's KHR_materials_clearcoat).
vec3 coated(vec3 below, SurfaceMaterial surface, vec3 d_view) {
  vec3 n = surface.n_coat;
  vec3 mirrored = surface.occlusion * specular_soft_light(vec3(1), surface.coat_roughness, n, d_view);
  for (int i = 0; i < u_lamp_count; ++i)
    mirrored += u_lamps[i].rgb *
                lamp_reflection(vec3(0), vec3(1), 1.0, surface.coat_roughness, n, d_view, u_d_lamps[i].xyz);
  float x = 1.0 - abs(dot(n, d_view));
  return mix(below, mirrored, surface.coat * (0.04 + 0.96 * x * x * x * x * x));
}

// Shades a surface in the room light, seen from direction d_view; its normals are those on that side.
vec3 shaded(SurfaceMaterial surface, vec3 d_view) {
  vec3 n = surface.n;
  float specular = surface.is_diffuse ? 0.0 : 1.0;
  vec3 diffuse = surface.base * (1.0 - surface.metallic), f0 = mix(vec3(0.04), surface.base, surface.metallic);
  vec3 colour = (1.0 - specular * f0) * diffuse * diffuse_soft_light(n);
  colour += specular * specular_soft_light(f0, surface.roughness, n, d_view);
  colour *= surface.occlusion;
  for (int i = 0; i < u_lamp_count; ++i)
    colour += u_lamps[i].rgb *
              lamp_reflection(diffuse, f0, specular, surface.roughness, n, d_view, u_d_lamps[i].xyz);
  colour += surface.emitted;
#ifdef CLEARCOAT
  if (surface.coat > 0.0) colour = coated(colour, surface, d_view);
#endif
  return colour;
}

// The surface with its normals on the side (1, -1) of the mesh's, and turned to the viewer, who looks along d.
SurfaceMaterial turned_to_viewer(SurfaceMaterial surface, float side, vec3 d) {
  surface.n = turned_to_viewer(side * surface.n, d);
  surface.n_coat = turned_to_viewer(side * surface.n_coat, d);
  return surface;
}

// Colour seen along the ray direction d; `footprint` is the side (m) of the pixel's patch on the surface.
vec3 radiance_along(vec3 d, Hit hit, float footprint) {
  if (is_unlit(hit)) return base_colour(hit, footprint);
  SurfaceMaterial surface = surface_material_at(hit, footprint);
  return shaded(turned_to_viewer(surface, facing_sign(surface.n_smooth, hit, d), d), -d);
}

// Light of a surface that is the same for every viewer: shaded as seen along the prototype's normal, and
// illuminated from there if no room light is known.
vec3 light_on_surface(SurfaceMaterial surface, vec3 d_prototype_normal) {
  float side = dot(surface.n_smooth, d_prototype_normal) < 0.0 ? -1.0 : 1.0;
  surface = turned_to_viewer(surface, side, -d_prototype_normal);
  if (u_has_room_light) return shaded(surface, d_prototype_normal);
  vec3 light = surface.occlusion * u_soft_above.rgb + u_lamps[0].rgb * dot(surface.n, d_prototype_normal);
  return surface.base * light + surface.emitted;
}

// Colour of a part that lies on the surface.
vec3 radiance_on_surface(Hit hit, vec3 d_prototype_normal, float footprint) {
  if (is_unlit(hit)) return base_colour(hit, footprint);
  return light_on_surface(surface_material_at(hit, footprint), d_prototype_normal);
}
