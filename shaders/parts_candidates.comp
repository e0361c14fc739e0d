#version 450 core
// Lists the pixels of a camera that may see a part or its shadow.
#include "parts.glsl"
#include "work_list.glsl"
layout(local_size_x = 16, local_size_y = 4) in;
uniform ivec2 u_first, u_end;  // the rectangle to search

void main() {
  ivec2 at = u_first + ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(at, u_end))) return;
  vec4 share;
  Viewpoint viewer = viewpoint_at(u_viewer);
  vec3 d = ray_of(viewer, vec2(at));
  if (ids_around(s_viewer_ids, viewer, 1, d, share) != uvec4(0) ||
      ((k_contact_shadow || is_painted()) && ids_around(s_viewer_ids, viewer, 0, d, share) != uvec4(0))) {
    add_to_work_list(at);
  }
}
