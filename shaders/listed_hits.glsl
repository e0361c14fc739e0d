// What the listed pixels' centres see of the prototype, kept from the pass that lists to the one that works through.
#include "listed.glsl"

layout(std430, binding = 7) buffer Hits { uvec4 s_hits[]; };  // id; bits of t and of two weights

void list_hit(ivec2 at, Hit hit) {
  s_hits[list_pixel(at)] = uvec4(hit.id, floatBitsToUint(vec3(hit.t, hit.weights.yz)));
}

Hit listed_hit(uint i) {
  vec3 hit = uintBitsToFloat(s_hits[i].yzw);
  return Hit(s_hits[i].x, hit.x, vec3(1.0 - hit.y - hit.z, hit.yz), 0.0);
}
