#version 450 core
// Irradiance from projector u_projector on the prototype, for each pixel of a camera; 0 where the projector
// does not reach.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "projector_blending.glsl"
layout(location = 0) out float o_irradiance;
layout(binding = k_viewer_ids_unit) uniform usampler2DArray s_viewer_ids;
uniform int u_viewer, u_projector;

void main() {
  Viewpoint viewer = viewpoint_at(u_viewer);
  vec3 d = ray_of(viewer, floor(gl_FragCoord.xy));
  Hit hit = first_hit(s_viewer_ids, viewer, 0, d);
  o_irradiance = 0.0;
  if (hit.id == 0u) return;
  Illumination illumination = illumination_from(u_projector, place_at(hit, d), false);
  if (illumination.quality > 0.0) o_irradiance = illumination.irradiance;
}
