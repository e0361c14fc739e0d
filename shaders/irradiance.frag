#version 450 core
// Irradiance from projector u_projector on the prototype, for each pixel of a camera; 0 where the projector
// does not reach.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
layout(location = 0) out float o_irradiance;
layout(binding = k_eye_ids_unit) uniform usampler2DArray s_eye_ids;
uniform int u_eye, u_projector;

void main() {
  Sight eye = sight_at(u_eye);
  vec3 d = ray_of(eye, floor(gl_FragCoord.xy));
  Hit hit = first_hit(s_eye_ids, eye, 0, d);
  o_irradiance = 0.0;
  if (hit.id == 0u) return;
  Reach reach = reach(u_projector, place_at(hit, d), false);
  if (reach.quality > 0.0) o_irradiance = reach.irradiance;
}
