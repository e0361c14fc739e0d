// What a part's surface looks like: linear light.

// Shading where a material is not unlit: a hemisphere of soft light around an up direction, and lamps far away. Scene
// frame; light is that of a white surface that faces it.
const int k_most_lamps = 4;
uniform vec4 u_d_up, u_soft_below, u_soft_above;
uniform vec4 u_d_lamps[k_most_lamps], u_lamps[k_most_lamps];
uniform int u_lamp_count;
uniform bool u_is_room_known;  // else the light stands with the viewer

vec3 soft_light(float up) { return mix(u_soft_below.rgb, u_soft_above.rgb, 0.5 + 0.5 * up); }

// Share of the soft light that a surface mirrors, for its colour head on (Karis 2014, "Physically Based Shading on
// Mobile", a fit of the split sum).
vec3 mirrored_share(vec3 head_on, float roughness, float cosine) {
  vec4 r = roughness * vec4(-1, -0.0275, -0.572, 0.022) + vec4(1, 0.0425, 1.04, -0.04);
  float a = min(r.x * r.x, exp2(-9.28 * cosine)) * r.x + r.y;
  vec2 ab = vec2(-1.04, 1.04) * a + r.zw;
  return head_on * ab.x + ab.y;
}

// Mirrored light of a lamp of strength 1: GGX with Smith's shadowing (Walter et al. 2007; glTF 2.0, appendix B).
vec3 mirrored_lamp(vec3 head_on, float roughness, vec3 n, vec3 d_eye, vec3 d_lamp) {
  const float k_smoothest = 0.2;  // lamps have a size
  float a = pow(max(roughness, k_smoothest), 2.0), a2 = a * a;
  vec3 h = normalize(d_eye + d_lamp);
  float nl = dot(n, d_lamp), nv = max(1e-3, dot(n, d_eye)), nh = dot(n, h);
  if (nl <= 0.0) return vec3(0);
  float peak = nh * nh * (a2 - 1.0) + 1.0;
  float visible = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
  vec3 fresnel = head_on + (1.0 - head_on) * pow(1.0 - max(0.0, dot(d_eye, h)), 5.0);
  return nl * a2 / (peak * peak) * 0.5 / visible * fresnel;  // pi of strength and 1 / pi of GGX cancel
}

// A material's colour in the room's light.
vec3 lit(vec3 base, vec2 metallic_roughness, vec3 n, vec3 d_eye) {
  float metallic = metallic_roughness.x, roughness = metallic_roughness.y;
  vec3 light = soft_light(dot(n, u_d_up.xyz));
  for (int i = 0; i < u_lamp_count; ++i) light += u_lamps[i].rgb * max(0.0, dot(n, u_d_lamps[i].xyz));
  vec3 colour = base * (1.0 - metallic) * light;
  if (metallic == 0.0 && roughness == 1.0) return colour;
  vec3 head_on = mix(vec3(0.04), base, metallic);
  float up = dot(reflect(-d_eye, n), u_d_up.xyz);
  float horizon = mix(2.0 * smoothstep(-0.3, 0.3, up) - 1.0, up, roughness);
  colour += soft_light(horizon) * mirrored_share(head_on, roughness, max(0.0, dot(n, d_eye)));
  for (int i = 0; i < u_lamp_count; ++i)
    colour += u_lamps[i].rgb * mirrored_lamp(head_on, roughness, n, d_eye, u_d_lamps[i].xyz);
  return colour;
}

// Own colour at a hit; `footprint` is the side (m) of the pixel's patch on the surface.
vec3 base_colour(Hit hit, float footprint) {
  Triangle triangle = s_triangles[hit.id - 1u];
  Material material = s_materials[triangle.material];
  vec4 wanted = s_placements[triangle.owner].colour;
  vec3 colour = wanted.a > 0.5 ? wanted.rgb : material.colour.rgb;
  if (material.look.x < 0.0) return colour;
  vec2 uv = uv_of(hit);
  return colour * textureLod(s_looks, vec3(uv.x, 1.0 - uv.y, material.look.x), texture_lod(hit, footprint)).rgb;
}

bool is_unlit(Hit hit) {
  Triangle triangle = s_triangles[hit.id - 1u];
  return s_materials[triangle.material].colour.a > 0.5 && all(lessThan(s_placements[triangle.owner].look.xy, vec2(0)));
}

vec2 metallic_roughness(Hit hit) {
  Triangle triangle = s_triangles[hit.id - 1u];
  vec2 wanted = s_placements[triangle.owner].look.xy;
  return mix(wanted, s_materials[triangle.material].look.yz, lessThan(wanted, vec2(0)));
}

// Colour seen along d.
vec3 look_along(vec3 d, Hit hit, float footprint) {
  vec3 colour = base_colour(hit, footprint);
  if (is_unlit(hit)) return colour;
  return lit(colour, metallic_roughness(hit), facing_normal(hit, d), -d);
}

// Colour of a part that lies on the surface, the same for every eye: seen along the prototype's normal, and in light
// from there where no room is known.
vec3 look_on_surface(Hit hit, vec3 d_prototype_normal, float footprint) {
  vec3 colour = base_colour(hit, footprint);
  if (is_unlit(hit)) return colour;
  vec3 n = smooth_normal(hit);
  if (dot(n, d_prototype_normal) < 0.0) n = -n;
  if (!u_is_room_known) return colour * (u_soft_above.rgb + u_lamps[0].rgb * dot(n, d_prototype_normal));
  return lit(colour, metallic_roughness(hit), n, d_prototype_normal);
}
