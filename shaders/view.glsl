// Prototype and parts as a virtual camera sees them, in linear light; a: coverage.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "look.glsl"
#include "contact.glsl"

layout(binding = k_eye_ids_unit) uniform usampler2DArray s_eye_ids;
uniform int u_eye;
layout(binding = k_albedo_unit) uniform sampler2D s_albedo;  // albedo of the prototype divided by its mean
uniform float u_mean_albedo;

vec4 view_at(vec2 px) {
  Sight eye = sight_at(u_eye);
  vec3 d = ray_of(eye, px);
  Hit part = first_hit(s_eye_ids, eye, 1, d), prototype = first_hit(s_eye_ids, eye, 0, d);
  // A part that lies on the surface is drawn in front of it.
  const float k_on_it = 0.002;
  if (part.id != 0u && (prototype.id == 0u || part.t < prototype.t + k_on_it)) {
    return vec4(look_along(d, part, part.t / eye.quality.x), 1);
  }
  if (prototype.id == 0u) return vec4(0);
  vec3 n = facing_normal(prototype, d);
  vec2 uv = uv_of(prototype);
  vec3 colour = u_mean_albedo * texture(s_albedo, vec2(uv.x, 1.0 - uv.y)).rgb * diffuse_light(n);
  float shadow = k_contact_shadow ? contact_shadow(eye.p_eye.xyz + prototype.t * d, n) : 0.0;
  return vec4((1.0 - shadow) * colour, 1);
}
