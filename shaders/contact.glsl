// How much of the uniform light from all sides nearby view parts keep from a point
// (projector/contact_shadow.h). Compiled only if CONTACT_SHADOW is defined, because software GL would execute
// a branch even if it is not taken.
#include "bindings.glsl"

#ifndef CONTACT_SHADOW
const bool k_contact_shadow = false;
float contact_shadow(vec3 p, vec3 d_normal) { return 0.0; }
#else
const bool k_contact_shadow = true;

struct Field {
  vec4 lower;  // lower bound of the nodes, owner frame; w: 1 when the part is shown
  vec4 nodes_per_m;
  vec4 first;  // first node in the texture
  vec4 cut;    // height of q (owner frame) over the plane that cuts the part: dot(xyz, q) + w
};
layout(std430, binding = k_distance_fields_buffer) readonly buffer Fields { Field s_fields[]; };  // indexed by owner
layout(binding = k_distances_unit) uniform sampler3D s_distances;
uniform float u_free;      // m; a surface at this distance blocks no light
uniform float u_widening;  // radius of a cone divided by its length
uniform int u_placement_count;

const int k_field_nodes = 48;

float distance_to_part(Field field, vec3 q) {
  vec3 node = clamp((q - field.lower.xyz) * field.nodes_per_m.xyz, 0.0, float(k_field_nodes - 1));
  float whole = texture(s_distances, (field.first.xyz + node + 0.5) / vec3(textureSize(s_distances, 0))).x;
  return max(whole, dot(field.cut.xyz, q) + field.cut.w);  // what is kept is at least this far away
}

// Share of the light that one part keeps from the point q with unit normal n, both in the part's frame.
float kept_by_part(Field field, vec3 q, vec3 n) {
  const float k_steps[4] = float[](0.07, 0.2, 0.45, 0.75);
  vec3 aside = normalize(abs(n.x) < 0.7 ? cross(n, vec3(1, 0, 0)) : cross(n, vec3(0, 1, 0)));
  vec3 beside = cross(n, aside);
  float kept = 0.0;
  for (int cone = 0; cone < 6; ++cone) {  // one along the normal and five around it, weighted by the cosine
    float turn = 1.2566371 * float(cone);
    vec3 d = cone == 5 ? n : 0.5 * n + 0.8660254 * (cos(turn) * aside + sin(turn) * beside);
    float blocked = 0.0;
    for (int k = 0; k < 4; ++k) {
      float t = k_steps[k] * u_free;
      float cover = 1.0 - distance_to_part(field, q + t * d) / (u_widening * t);
      blocked = max(blocked, clamp(cover, 0.0, 1.0) * (1.0 - k_steps[k]));
    }
    kept += (cone == 5 ? 0.25 : 0.15) * blocked;
  }
  return kept;
}

// 0 where no part is near, up to 1.
float contact_shadow(vec3 p, vec3 d_normal) {
  float left = 1.0;
  for (int i = 1; i < u_placement_count; ++i) {
    Field field = s_fields[i];
    if (field.lower.w < 0.5) continue;
    vec3 q = to_owner(uint(i), p);
    vec3 node = (q - field.lower.xyz) * field.nodes_per_m.xyz;
    if (any(lessThan(node, vec3(0))) || any(greaterThan(node, vec3(k_field_nodes - 1)))) continue;
    if (distance_to_part(field, q) >= (1.0 + u_widening) * u_free) continue;
    left *= 1.0 - kept_by_part(field, q, turned_to_owner(uint(i), d_normal));
  }
  return 1.0 - left;
}
#endif
