#version 450 core
// Lists the pixels that need more than one sample: those beside an edge of coverage or colour in an image
// with one sample for each pixel. CACHED_SHARES: for a projector's image, pixels whose blending share is not
// cached are also left to light_shares.comp.
#include "bindings.glsl"
#include "work_list.glsl"
#ifdef CACHED_SHARES
#include "deferred_list.glsl"
layout(rgba32f, binding = k_cached_shares_image) uniform readonly image2D u_cached_shares;  // as hit_cache.glsl
#endif
layout(local_size_x = 16, local_size_y = 4) in;
layout(binding = k_light_unit) uniform sampler2D s_light;  // linear light, a: coverage
uniform ivec2 u_first, u_end;  // the rectangle to search
uniform float u_least_step;  // smallest difference that counts as an edge, as a fraction of full light

void main() {
  ivec2 at = u_first + ivec2(gl_GlobalInvocationID.xy);
  ivec2 last = textureSize(s_light, 0) - 1;
  if (any(greaterThanEqual(at, u_end))) return;
  vec4 lowest = vec4(1e9), highest = vec4(-1e9);
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) {
      vec4 c = texelFetch(s_light, clamp(at + ivec2(x, y), ivec2(0), last), 0);
      lowest = min(lowest, c);
      highest = max(highest, c);
    }
  }
  if (!any(greaterThan(highest - lowest, vec4(u_least_step)))) return;
  add_to_work_list(at);
#ifdef CACHED_SHARES
  if (imageLoad(u_cached_shares, at).x < 0.0) defer_pixel(at);
#endif
}
