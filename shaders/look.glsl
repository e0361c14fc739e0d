// Shading of a part's surface, in linear light.
#include "bindings.glsl"
#include "material.glsl"

// The room light, for materials that are not unlit: hemispherical soft light around an up direction, and
// distant lamps. Directions are in the scene's frame; the light values are those reflected by a white surface
// that faces the light.
const int k_most_lamps = 4;
uniform vec4 u_d_up, u_soft_below, u_soft_above;
uniform vec4 u_d_lamps[k_most_lamps], u_lamps[k_most_lamps];
uniform int u_lamp_count;
uniform bool u_is_room_known;  // else the light moves with the viewer

// Soft light of which the share `above` comes from above.
vec3 soft_light(float above) { return mix(u_soft_below.rgb, u_soft_above.rgb, above); }

// Light reflected by a white diffuse surface.
vec3 diffuse_light(vec3 n) {
  vec3 light = soft_light(0.5 + 0.5 * dot(n, u_d_up.xyz));
  for (int i = 0; i < u_lamp_count; ++i) light += u_lamps[i].rgb * max(0.0, dot(n, u_d_lamps[i].xyz));
  return light;
}

// The table of projector/brdf_lut.h. Indexed by cosine and roughness: factors of the colour at normal
// incidence (red) and of white (green), and where most of the reflected light comes from, between the normal
// (0) and the mirror direction (1) (alpha). Indexed by height (-1 to 1) and roughness: the share of the
// reflected light that comes from above (blue).
layout(binding = k_brdf_lut_unit) uniform sampler2D s_mirrored;

vec4 mirrored_at(float x, float roughness) {
  const float k_nodes = 32.0;
  return textureLod(s_mirrored, (vec2(x, roughness) * (k_nodes - 1.0) + 0.5) / k_nodes, 0.0);
}

vec3 mirrored_soft_light(vec3 head_on, float roughness, vec3 n, vec3 d_eye) {
  vec4 share = mirrored_at(max(0.0, dot(n, d_eye)), roughness);
  vec3 d = normalize(mix(n, reflect(-d_eye, n), share.a));
  float above = mirrored_at(0.5 + 0.5 * dot(d, u_d_up.xyz), roughness).b;
  return soft_light(above) * (head_on * share.r + share.g);
}

// Light of a lamp reflected by a surface with a diffuse colour and a reflectance at normal incidence
// (`head_on`): GGX with Smith's shadowing, layers mixed by the Fresnel term (glTF 2.0, appendix B; Walter et
// al. 2007). With `gloss` 0 it is purely diffuse. A branch is avoided, because software GL would execute both
// sides.
vec3 of_lamp(vec3 diffuse, vec3 head_on, float gloss, float roughness, vec3 n, vec3 d_eye, vec3 d_lamp) {
  const float k_smoothest = 0.2;  // smallest roughness for lamps, because real lamps have a size
  float r = max(roughness, k_smoothest), a2 = r * r * r * r;
  vec3 h = d_eye + d_lamp;
  h *= inversesqrt(max(1e-12, dot(h, h)));  // the limit matters where both directions are opposite
  float nl = max(0.0, dot(n, d_lamp)), nv = max(1e-3, dot(n, d_eye)), nh = dot(n, h);
  float peak = nh * nh * (a2 - 1.0) + 1.0;
  float visible = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
  float x = 1.0 - max(0.0, dot(d_eye, h)), grazing = x * x * x * x * x;
  vec3 fresnel = gloss * (head_on + (1.0 - head_on) * grazing);
  // The factors pi of the lamp and 1 / pi of the surface cancel.
  return nl * ((1.0 - fresnel) * diffuse + a2 / (peak * peak) * 0.5 / visible * fresnel);
}

// Shades a finish in the room light, seen from direction d_eye; n is the normal on that side.
vec3 lit(Finish finish, vec3 n, vec3 d_eye) {
  float gloss = finish.is_plain ? 0.0 : 1.0;
  vec3 diffuse = finish.base * (1.0 - finish.metallic), head_on = mix(vec3(0.04), finish.base, finish.metallic);
  vec3 colour = (1.0 - gloss * head_on) * diffuse * soft_light(0.5 + 0.5 * dot(n, u_d_up.xyz));
  colour += gloss * mirrored_soft_light(head_on, finish.roughness, n, d_eye);
  colour *= finish.open;
  for (int i = 0; i < u_lamp_count; ++i)
    colour += u_lamps[i].rgb * of_lamp(diffuse, head_on, gloss, finish.roughness, n, d_eye, u_d_lamps[i].xyz);
  return colour + finish.emitted;
}

// Colour seen along the ray direction d; `footprint` is the side (m) of the pixel's patch on the surface.
vec3 look_along(vec3 d, Hit hit, float footprint) {
  if (is_unlit(hit)) return base_colour(hit, footprint);
  Finish finish = finish_at(hit, footprint);
  return lit(finish, not_away(side_seen(finish.n_smooth, hit, d) * finish.n, d), -d);
}

// Colour of a part that lies on the surface. It is the same for every viewer: shaded as seen along the
// prototype's normal, and illuminated from there if no room light is known.
vec3 radiance_on_surface(Hit hit, vec3 d_prototype_normal, float footprint) {
  if (is_unlit(hit)) return base_colour(hit, footprint);
  Finish finish = finish_at(hit, footprint);
  float side = dot(finish.n_smooth, d_prototype_normal) < 0.0 ? -1.0 : 1.0;
  vec3 n = not_away(side * finish.n, -d_prototype_normal);
  if (u_is_room_known) return lit(finish, n, d_prototype_normal);
  vec3 light = finish.open * u_soft_above.rgb + u_lamps[0].rgb * dot(n, d_prototype_normal);
  return finish.base * light + finish.emitted;
}
