// How the 3D views shade a surface: glTF's metallic-roughness material with maps, emission and a clear layer, in a light that stays
// with the viewer: a lamp, and soft light from above and below.

// The textures of a material besides its colour, in the order of their texture units and bits.
const k_maps = ["metallic_roughness", "normals", "emission", "coat", "coat_roughness", "coat_normals", "occlusion"];
const k_first_unit = 8; // the views use the units below

/** Vertex shader: the inputs of upload_mesh(), and what k_material reads. `pass_material(mat3 view_from_model)` writes it. */
export const k_material_inputs = `
in vec3 a_normal;
in vec2 a_uv, a_second_uv;
in vec4 a_tangent;
out vec3 v_normal;
out vec2 v_uv, v_second_uv;
out vec4 v_tangent;
void pass_material(mat3 view_from_model) {
  v_normal = view_from_model * a_normal;
  v_tangent = vec4(view_from_model * a_tangent.xyz, a_tangent.w);
  v_uv = a_uv;
  v_second_uv = a_second_uv;
}`;

/** Fragment shader: `material_texel()` is the texel of the colour, `material_light(texel, eye)` the linear light towards the viewer. */
export const k_material = `
uniform vec4 u_base;
uniform sampler2D u_texture, u_${k_maps.join(", u_")};
uniform int u_in_second; // a bit for each map that lies in the second texture coordinates
uniform vec2 u_factors, u_coat_factors; // metalness and roughness; share and roughness of the clear layer
uniform vec2 u_normal_scales; // of the normals, and of the clear layer's; 0: no map
uniform float u_occlusion_strength; // how much the occlusion map takes from soft light; 0: no map
uniform vec3 u_emitted;
uniform bool u_is_diffuse;
uniform float u_unlit;
in vec3 v_normal;
in vec2 v_uv, v_second_uv;
in vec4 v_tangent;
const vec3 k_key = vec3(0.447, 0.716, 0.537); // direction of the lamp
const float k_key_light = 0.75;

vec2 uv_of(int map) { return (u_in_second >> map & 1) == 1 ? v_second_uv : v_uv; }

vec3 mapped_normal(vec3 n, vec3 texel, float scale) {
  if (scale == 0.0) return n;
  vec3 u = normalize(v_tangent.xyz - dot(v_tangent.xyz, n) * n), v = (v_tangent.w < 0.0 ? -1.0 : 1.0) * cross(n, u);
  vec3 along = (2.0 * texel - 1.0) * vec3(scale, scale, 1);
  return normalize(along.x * u + along.y * v + along.z * n);
}

// The normal on the viewer's side; one that looks away is seen at its edge.
vec3 turned_to_viewer(vec3 n, vec3 eye) {
  float nv = dot(n, eye);
  return nv < 0.0 ? normalize(n - nv * eye) : n;
}

// Soft light from direction d; a rough surface mixes what is around it.
vec3 soft_from(vec3 d, float roughness) {
  float horizon = 0.1 + 0.9 * roughness;
  return vec3(mix(0.16, 0.38, smoothstep(-horizon, horizon, d.y)));
}

// Shares of the colour at normal incidence and of white in mirrored soft light (B. Karis, "Physically based shading on mobile", 2014).
vec2 mirrored_shares(float roughness, float nv) {
  vec4 r = roughness * vec4(-1, -0.0275, -0.572, 0.022) + vec4(1, 0.0425, 1.04, -0.04);
  float a = min(r.x * r.x, exp2(-9.28 * nv)) * r.x + r.y;
  return vec2(-1.04, 1.04) * a + r.zw;
}

// What GGX mirrors of the lamp, where all light is mirrored.
float mirrored_lamp(float roughness, vec3 n, vec3 eye) {
  float r = max(roughness, 0.2), a2 = r * r * r * r; // a lamp has a size
  vec3 h = normalize(k_key + eye);
  float nl = max(dot(n, k_key), 0.0), nv = max(dot(n, eye), 1e-3), nh = dot(n, h), peak = nh * nh * (a2 - 1.0) + 1.0;
  return nl * a2 / (peak * peak) * 0.5 / (nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2) + 1e-6);
}

float schlick(float cosine) { return pow(1.0 - clamp(cosine, 0.0, 1.0), 5.0); }

// "open": share of the soft light that arrives.
vec3 mirrored(vec3 f0, float roughness, vec3 n, vec3 eye, float open) {
  vec2 shares = mirrored_shares(roughness, max(dot(n, eye), 0.0));
  vec3 fresnel = f0 + (1.0 - f0) * schlick(dot(eye, normalize(k_key + eye)));
  return open * soft_from(reflect(-eye, n), roughness) * (f0 * shares.x + shares.y) +
         k_key_light * fresnel * mirrored_lamp(roughness, n, eye);
}

vec4 material_texel() { return texture(u_texture, v_uv); }

vec3 material_light(vec4 texel, vec3 eye) {
  vec3 base = u_base.rgb * texel.rgb, n_mesh = normalize(v_normal);
  float side = dot(n_mesh, eye) < 0.0 ? -1.0 : 1.0;
  vec3 n = turned_to_viewer(side * mapped_normal(n_mesh, texture(u_normals, uv_of(1)).rgb, u_normal_scales.x), eye);
  float open = 1.0 + u_occlusion_strength * (texture(u_occlusion, uv_of(6)).r - 1.0);
  vec3 map = texture(u_metallic_roughness, uv_of(0)).rgb;
  float metallic = u_factors.x * map.b, roughness = u_factors.y * map.g;
  float key = max(dot(n, k_key), 0.0), rim = pow(1.0 - max(dot(n, eye), 0.0), 3.0);
  vec3 f0 = mix(vec3(0.04), base, metallic);
  vec3 diffuse = base * (1.0 - metallic) * (u_is_diffuse ? vec3(1) : 1.0 - f0);
  vec3 light = diffuse * (open * (0.16 + 0.22 * (0.5 + 0.5 * n.y)) + k_key_light * key) + vec3(0.06) * rim;
  if (!u_is_diffuse) light += mirrored(f0, roughness, n, eye, open);
  light += u_emitted * texture(u_emission, uv_of(2)).rgb;
  vec2 coat = u_coat_factors * vec2(texture(u_coat, uv_of(3)).r, texture(u_coat_roughness, uv_of(4)).g);
  vec3 n_coat = turned_to_viewer(side * mapped_normal(n_mesh, texture(u_coat_normals, uv_of(5)).rgb, u_normal_scales.y), eye);
  float covered = coat.x * (0.04 + 0.96 * schlick(abs(dot(n_coat, eye))));
  light = mix(light, mirrored(vec3(1), coat.y, n_coat, eye, open), covered);
  return mix(light, base, u_unlit);
}`;

/** The textures of a mesh of read_glb() on the GPU; `make(picture, is_colour)` makes one. */
export function upload_maps(mesh, make) {
  return k_maps.map((name) => make(mesh.maps[name]?.picture, name === "emission"));
}

/** Binds an uploaded mesh's material. `at`: location of a uniform. `base`: linear RGBA instead of the mesh's own. */
export function bind_material(gl, at, mesh, base = mesh.base) {
  gl.uniform4fv(at("u_base"), base);
  gl.uniform2f(at("u_factors"), mesh.metallic, mesh.roughness);
  gl.uniform2f(at("u_coat_factors"), mesh.coat, mesh.coat_roughness);
  gl.uniform2f(at("u_normal_scales"), mesh.maps.normals?.scale ?? 0, mesh.maps.coat_normals?.scale ?? 0);
  gl.uniform1f(at("u_occlusion_strength"), mesh.maps.occlusion?.strength ?? 0);
  gl.uniform3fv(at("u_emitted"), mesh.emitted);
  gl.uniform1i(at("u_is_diffuse"), mesh.metallic === 0 && mesh.roughness === 1 && !mesh.maps.metallic_roughness ? 1 : 0);
  gl.uniform1f(at("u_unlit"), mesh.is_unlit ? 1 : 0);
  gl.uniform1i(
    at("u_in_second"),
    k_maps.reduce((bits, name, i) => bits | ((mesh.maps[name]?.set ?? 0) << i), 0),
  );
  k_maps.forEach((name, i) => {
    gl.activeTexture(gl.TEXTURE0 + k_first_unit + i);
    gl.bindTexture(gl.TEXTURE_2D, mesh.map_textures[i]);
    gl.uniform1i(at(`u_${name}`), k_first_unit + i);
  });
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, mesh.texture);
  gl.uniform1i(at("u_texture"), 0);
}
