#version 450 core
// The prototype's point lit by each pixel of a projector, in the scene's frame; w: 0 where there is none.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
layout(location = 0) out vec4 o_point;
layout(binding = k_projector_ids_unit) uniform usampler2DArray s_projector_ids;
uniform int u_projector;

void main() {
  Viewpoint projector = viewpoint_at(u_projector);
  vec3 d = ray_of(projector, floor(gl_FragCoord.xy));
  Hit hit = first_hit(s_projector_ids, projector, 0, d);
  o_point = hit.id == 0u ? vec4(0) : vec4(projector.p_origin.xyz + hit.t * d, 1);
}
