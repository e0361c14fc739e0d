#version 450 core
// The listed blocks contain a depth edge in one projector's image. Marks those where another projector lights
// the surface beside the edge, so that it can take over. Where the prototype ends for all projectors, none
// can take over.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
#include "listed.glsl"
layout(local_size_x = 64) in;
layout(r8, binding = k_edge_marks_image) uniform writeonly image2D u_marks;
// Output of shaders/jumps.comp for each projector.
layout(binding = k_depth_edges_unit) uniform sampler2DArray s_jumps;
uniform int u_projector;

// Whether projector j has a depth edge in the blocks around a point (scene frame).
bool is_beside_jump(int j, vec3 p) {
  Sight sight = sight_at(j);
  vec3 q = (sight.sight_from_scene * vec4(p, 1)).xyz;
  vec2 texel = sight.focal_centre.xy * q.xy / q.z + sight.focal_centre.zw + 0.5;
  ivec2 block = ivec2(floor(texel / float(k_block))), last = (ivec2(sight.size.xy) - 1) / k_block;
  bool is_beside = false;
  for (int i = 0; i < 9; ++i) {
    ivec2 at = clamp(block + ivec2(i % 3, i / 3) - 1, ivec2(0), last);
    is_beside = is_beside || texelFetch(s_jumps, ivec3(at, int(sight.quality.z)), 0).x >= 0.0;
  }
  return is_beside;
}

// Whether another projector lights the point that this one sees in a texel, and has no depth edge there.
bool goes_on(vec2 texel) {
  Sight own = sight_at(u_projector);
  vec3 d = normalize(vec3((texel - own.focal_centre.zw) / own.focal_centre.xy, 1)) * mat3(own.sight_from_scene);
  Hit hit = first_hit(s_projector_ids, own, 0, d);
  if (hit.id == 0u) return false;
  Place place = place_at(hit, d);
  int j = u_projector == 0 ? 1 : 0;
  bool is_lit = false;
  do {
    is_lit = !is_beside_jump(j, place.p) && reaches(j, place);
    if (++j == u_projector) ++j;
  } while (!is_lit && j < u_projector_count);
  return is_lit;
}

void main() {
  if (!is_listed()) return;
  ivec2 block = listed_pixel();
  vec4 jump = texelFetch(s_jumps, ivec3(block, int(sight_at(u_projector).quality.z)), 0);
  bool is_handed = false;
  vec2 side = jump.xy;
  int k = 0;
  do {
    is_handed = goes_on(side);
    side = jump.zw;
  } while (!is_handed && side.x >= 0.0 && ++k < 2);
  if (is_handed) imageStore(u_marks, block, vec4(1));
}
