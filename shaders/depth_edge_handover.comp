#version 450 core
// The listed blocks contain a depth edge in one projector's image. Marks those where another projector lights
// the surface beside the edge, so that it can take over. Where the prototype ends for all projectors, none
// can take over.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "projector_blending.glsl"
#include "work_list.glsl"
layout(local_size_x = 64) in;
layout(r8, binding = k_edge_marks_image) uniform writeonly image2D u_marks;
// Output of shaders/depth_edges.comp for each projector.
layout(binding = k_depth_edges_unit) uniform sampler2DArray s_depth_edges;
uniform int u_projector;

// Whether projector j has a depth edge in the blocks around a point (scene frame).
bool is_near_depth_edge(int j, vec3 p) {
  Viewpoint viewpoint = viewpoint_at(j);
  vec3 q = (viewpoint.pinhole_from_scene * vec4(p, 1)).xyz;
  vec2 texel = viewpoint.focal_centre.xy * q.xy / q.z + viewpoint.focal_centre.zw + 0.5;
  ivec2 block = ivec2(floor(texel / float(k_block))), last = (ivec2(viewpoint.size.xy) - 1) / k_block;
  bool is_near = false;
  for (int i = 0; i < 9; ++i) {
    ivec2 at = clamp(block + ivec2(i % 3, i / 3) - 1, ivec2(0), last);
    is_near = is_near || texelFetch(s_depth_edges, ivec3(at, int(viewpoint.quality.z)), 0).x >= 0.0;
  }
  return is_near;
}

// Whether another projector lights the point that this one sees in a texel, and has no depth edge there.
bool can_hand_over(vec2 texel) {
  Viewpoint own = viewpoint_at(u_projector);
  vec3 d = normalize(vec3((texel - own.focal_centre.zw) / own.focal_centre.xy, 1)) * mat3(own.pinhole_from_scene);
  Hit hit = first_hit(s_projector_ids, own, 0, d);
  if (hit.id == 0u) return false;
  Place place = place_at(hit, d);
  int j = u_projector == 0 ? 1 : 0;
  bool is_found = false;
  do {
    is_found = !is_near_depth_edge(j, place.p) && reaches(j, place);
    if (++j == u_projector) ++j;
  } while (!is_found && j < u_projector_count);
  return is_found;
}

void main() {
  if (!has_work()) return;
  ivec2 block = work_pixel();
  vec4 edge = texelFetch(s_depth_edges, ivec3(block, int(viewpoint_at(u_projector).quality.z)), 0);
  bool is_handed_over = false;
  vec2 side = edge.xy;
  int k = 0;
  do {
    is_handed_over = can_hand_over(side);
    side = edge.zw;
  } while (!is_handed_over && side.x >= 0.0 && ++k < 2);
  if (is_handed_over) imageStore(u_marks, block, vec4(1));
}
