#version 450 core
// The light at the centre of each square patch of a camera's image. rgb: pixel of projector u_projector (rg)
// and its irradiance there (b), 0 where it does not reach; for u_projector = -1, the prototype's point in the
// scene's frame. a: 0 where the camera does not see the prototype.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "projector_blending.glsl"
layout(location = 0) out vec4 o_patch;
layout(binding = k_viewer_ids_unit) uniform usampler2DArray s_viewer_ids;
uniform int u_viewer, u_projector;
uniform float u_side;  // side of a patch, pixels

void main() {
  Viewpoint viewer = viewpoint_at(u_viewer);
  vec3 d = ray_of(viewer, (floor(gl_FragCoord.xy) + 0.5) * u_side - 0.5);
  Hit hit = first_hit(s_viewer_ids, viewer, 0, d);
  o_patch = vec4(0);
  if (hit.id == 0u) return;
  Place place = place_at(hit, d);
  o_patch = vec4(place.p, 1);
  if (u_projector < 0) return;
  Viewpoint projector = viewpoint_at(u_projector);
  Illumination illumination = illumination_from(u_projector, place, false);
  vec3 q = (projector.pinhole_from_scene * vec4(place.p, 1)).xyz;
  o_patch.xyz =
      illumination.quality > 0.0 ? vec3(pixel_of(projector, q.xy / q.z), illumination.irradiance) : vec3(0);
}
