#version 450 core
// Marks the blocks of a projector's picture in which depth jumps and another projector's light goes on: there it hands its
// own over. Where the prototype ends for all of them there is nobody to hand it to.
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(r8, binding = 0) uniform writeonly image2D u_marks;
uniform sampler2DArray s_jumps;  // shaders/jumps.comp, for each projector
uniform int u_projector;
uniform ivec2 u_blocks;

// Whether projector j sees a jump of depth in the blocks around a point (scene frame).
bool is_beside_jump(int j, vec3 p) {
  Sight sight = sight_at(j);
  vec3 q = (sight.sight_from_scene * vec4(p, 1)).xyz;
  vec2 texel = sight.focal_centre.xy * q.xy / q.z + sight.focal_centre.zw + 0.5;
  ivec2 block = ivec2(floor(texel / float(k_block))), last = (ivec2(sight.size.xy) - 1) / k_block;
  for (int y = max(0, block.y - 1); y <= min(last.y, block.y + 1); ++y)
    for (int x = max(0, block.x - 1); x <= min(last.x, block.x + 1); ++x)
      if (texelFetch(s_jumps, ivec3(x, y, int(sight.quality.z)), 0).x >= 0.0) return true;
  return false;
}

// Whether another projector lights what this one sees in a texel, and sees no jump there.
bool goes_on(vec2 texel) {
  Sight own = sight_at(u_projector);
  vec3 d = normalize(vec3((texel - own.focal_centre.zw) / own.focal_centre.xy, 1)) * mat3(own.sight_from_scene);
  Hit hit = first_hit(s_projector_ids, own, 0, d);
  if (hit.id == 0u) return false;
  Place place = place_at(hit, d);
  for (int j = 0; j < u_projector_count; ++j)
    if (j != u_projector && !is_beside_jump(j, place.p) && reaches(j, place)) return true;
  return false;
}

void main() {
  ivec2 block = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(block, u_blocks))) return;
  vec4 jump = texelFetch(s_jumps, ivec3(block, int(sight_at(u_projector).quality.z)), 0);
  bool is_handed = jump.x >= 0.0 && (goes_on(jump.xy) || (jump.z >= 0.0 && goes_on(jump.zw)));
  imageStore(u_marks, block, vec4(is_handed ? 1.0 : 0.0));
}
