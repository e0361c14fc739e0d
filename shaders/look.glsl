// What a part's surface looks like: linear light.

uniform sampler2DArray s_looks;  // all textures, one a layer, sRGB decoded on reading

// Shading where a material is not unlit: a hemisphere of soft light around the viewer's up direction and one lamp
// above the viewer's left shoulder, both standing with the viewer, since no room is known. Scene frame.
uniform vec4 u_d_up, u_d_lamp;
const float k_soft_below = 0.15, k_soft_above = 0.35, k_lamp = 0.65;

float texture_lod(Hit hit, float footprint) {
  uint first = 3u * (hit.id - 1u);
  vec3 ab = s_corners[first + 1u].xyz - s_corners[first].xyz;
  vec3 ac = s_corners[first + 2u].xyz - s_corners[first].xyz;
  vec2 uv = vec2(s_corners[first].w, s_normals[first].w);
  vec2 uv_ab = vec2(s_corners[first + 1u].w, s_normals[first + 1u].w) - uv;
  vec2 uv_ac = vec2(s_corners[first + 2u].w, s_normals[first + 2u].w) - uv;
  vec2 texels = vec2(textureSize(s_looks, 0).xy);
  float texel_area = abs(uv_ab.x * uv_ac.y - uv_ab.y * uv_ac.x) * texels.x * texels.y;
  float area = length(cross(ab, ac));
  return area > 0.0 ? max(0.0, log2(footprint * sqrt(texel_area / area))) : 0.0;
}

// Own colour at a hit; `footprint` is the side (m) of the pixel's patch on the surface.
vec3 base_colour(Hit hit, float footprint) {
  Material material = s_materials[s_owners[hit.id - 1u].y];
  vec3 colour = material.colour.rgb;
  if (material.look.x < 0.0) return colour;
  uint first = 3u * (hit.id - 1u);
  vec2 uv = mat3x2(vec2(s_corners[first].w, s_normals[first].w),
                   vec2(s_corners[first + 1u].w, s_normals[first + 1u].w),
                   vec2(s_corners[first + 2u].w, s_normals[first + 2u].w)) * hit.weights;
  return colour * textureLod(s_looks, vec3(uv.x, 1.0 - uv.y, material.look.x), texture_lod(hit, footprint)).rgb;
}

bool is_unlit(Hit hit) { return s_materials[s_owners[hit.id - 1u].y].colour.a > 0.5; }

// Colour seen along d.
vec3 look_along(vec3 d, Hit hit, float footprint) {
  vec3 colour = base_colour(hit, footprint);
  if (is_unlit(hit)) return colour;
  vec3 n = smooth_normal(hit);
  if (dot(n, d) > 0.0) n = -n;
  float soft = mix(k_soft_below, k_soft_above, 0.5 + 0.5 * dot(n, u_d_up.xyz));
  return colour * (soft + k_lamp * max(0.0, dot(n, u_d_lamp.xyz)));
}

// Colour of a part that lies on the surface, the same for every eye: as if lit and seen along the prototype's normal.
vec3 look_on_surface(Hit hit, vec3 d_prototype_normal, float footprint) {
  vec3 colour = base_colour(hit, footprint);
  if (is_unlit(hit)) return colour;
  return colour * (k_soft_above + k_lamp * abs(dot(smooth_normal(hit), d_prototype_normal)));
}
