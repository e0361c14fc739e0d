#version 450 core
// The light at the centre of each square patch of a camera's image. rgb: pixel of projector u_projector (rg)
// and its irradiance there (b), 0 where it does not reach; for u_projector = -1, the prototype's point in the
// scene's frame. a: 0 where the camera does not see the prototype.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
layout(location = 0) out vec4 o_lit;
layout(binding = k_eye_ids_unit) uniform usampler2DArray s_eye_ids;
uniform int u_eye, u_projector;
uniform float u_side;  // side of a patch, pixels

void main() {
  Sight eye = sight_at(u_eye);
  vec3 d = ray_of(eye, (floor(gl_FragCoord.xy) + 0.5) * u_side - 0.5);
  Hit hit = first_hit(s_eye_ids, eye, 0, d);
  o_lit = vec4(0);
  if (hit.id == 0u) return;
  Place place = place_at(hit, d);
  o_lit = vec4(place.p, 1);
  if (u_projector < 0) return;
  Sight projector = sight_at(u_projector);
  Reach reach = reach(u_projector, place, false);
  vec3 q = (projector.sight_from_scene * vec4(place.p, 1)).xyz;
  o_lit.xyz = reach.quality > 0.0 ? vec3(pixel_of(projector, q.xy / q.z), reach.irradiance) : vec3(0);
}
