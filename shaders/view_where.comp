#version 450 core
// Lists the pixels of a virtual camera that may see something.
#include "view.glsl"
#include "listed.glsl"
layout(local_size_x = 16, local_size_y = 4) in;
uniform ivec2 u_first, u_end;  // the rectangle to search

void main() {
  ivec2 at = u_first + ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(at, u_end))) return;
  vec4 share;
  Sight eye = sight_at(u_eye);
  vec3 d = ray_of(eye, vec2(at));
  if ((ids_around(s_eye_ids, eye, 0, d, share) | ids_around(s_eye_ids, eye, 1, d, share)) != uvec4(0)) list_pixel(at);
}
