// The imager's lens as a table: tangents (x/z, y/z) of every `step`-th pixel.
#include "bindings.glsl"

layout(binding = k_tangents_unit) uniform sampler2D s_tangents;
uniform vec4 u_tangents;  // x: step (px), yz: number of nodes

// Bilinear interpolation. The hardware's filter is not used because it rounds its weights to 1/256.
vec2 bilinear(vec2 a, vec2 b, vec2 c, vec2 d, vec2 f) { return mix(mix(a, b, f.x), mix(c, d, f.x), f.y); }

// Direction of a pixel (integers are pixel centres) in the imager's frame, z = 1; NaN where the lens has
// none.
vec3 direction_of(vec2 px) {
  vec2 node = px / u_tangents.x;
  ivec2 first = clamp(ivec2(floor(node)), ivec2(0), ivec2(u_tangents.yz) - 2);
  return vec3(bilinear(texelFetch(s_tangents, first, 0).xy, texelFetch(s_tangents, first + ivec2(1, 0), 0).xy,
                       texelFetch(s_tangents, first + ivec2(0, 1), 0).xy,
                       texelFetch(s_tangents, first + ivec2(1, 1), 0).xy, node - vec2(first)),
              1);
}

// Unit direction of an imager's pixel in the scene's frame.
vec3 ray_of(Viewpoint viewpoint, vec2 px) {
  return normalize(direction_of(px) * mat3(viewpoint.pinhole_from_scene));
}
