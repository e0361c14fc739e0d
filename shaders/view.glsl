// Prototype and parts as a virtual camera sees them, in linear light; a: coverage.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "finish.glsl"
#include "contact.glsl"

layout(binding = k_viewer_ids_unit) uniform usampler2DArray s_viewer_ids;
uniform int u_viewer;
layout(binding = k_albedo_unit) uniform sampler2D s_albedo;  // albedo of the prototype divided by its mean
uniform float u_mean_albedo;

vec4 view_at(vec2 px) {
  Viewpoint viewer = viewpoint_at(u_viewer);
  vec3 d = ray_of(viewer, px);
  Hit part = first_hit(s_viewer_ids, viewer, 1, d), prototype = first_hit(s_viewer_ids, viewer, 0, d);
  // A part that lies on the surface is drawn in front of it.
  const float k_on_it = 0.002;
  if (part.id != 0u && (prototype.id == 0u || part.t < prototype.t + k_on_it)) {
    if (is_cap(part.id)) return vec4(cap_light(part, viewer.p_origin.xyz, d, part.t / viewer.quality.x), 1);
    return vec4(radiance_along(d, part, part.t / viewer.quality.x), 1);
  }
  if (prototype.id == 0u) return vec4(0);
  if (is_cap(prototype.id))
    return vec4(cap_light(prototype, viewer.p_origin.xyz, d, prototype.t / viewer.quality.x), 1);
  vec3 n = facing_normal(prototype, d);
  float shadow = k_contact_shadow ? contact_shadow(viewer.p_origin.xyz + prototype.t * d, n) : 0.0;
  vec3 p = viewer.p_origin.xyz + prototype.t * d;
  vec4 paint = paint_light(prototype, p, n, d, d, prototype.t / viewer.quality.x);
  if (paint.a == 1.0) return vec4((1.0 - shadow) * paint.rgb, 1);
  vec2 uv = uv_of(prototype);
  vec3 colour = u_mean_albedo * texture(s_albedo, vec2(uv.x, 1.0 - uv.y)).rgb * diffuse_light(n);
  return vec4((1.0 - shadow) * mix(colour, vec3(0), paint.a) + (1.0 - shadow) * paint.rgb, 1);
}
