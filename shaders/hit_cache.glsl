// The hit cache: which point of the prototype each pixel centre of a projector sees, and the blending share
// there. It is valid until the prototype moves or the occlusion changes.
#include "bindings.glsl"

// Triangle id, bits of two barycentric weights, and the u_cache_stamp of the entry.
layout(rgba32ui, binding = k_cached_hits_image) uniform uimage2D u_cached_hits;
// A Share; x is negative where it is not known yet.
layout(rgba32f, binding = k_cached_shares_image) uniform image2D u_cached_shares;
uniform uint u_cache_stamp;

bool is_hit_cached(ivec2 at) { return imageLoad(u_cached_hits, at).w == u_cache_stamp; }

// Computes what the centre sees and caches it. The share there is then unknown.
void cache_hit(ivec2 at) {
  Viewpoint projector = viewpoint_at(u_projector);
  Hit hit = first_hit(s_projector_ids, projector, 0, ray_of(projector, vec2(at)));
  imageStore(u_cached_hits, at, uvec4(hit.id, floatBitsToUint(hit.weights.yz), u_cache_stamp));
  imageStore(u_cached_shares, at, vec4(-1));
}

// The cached hit; is_hit_cached must be true.
Hit cached_hit(ivec2 at) {
  uvec4 entry = imageLoad(u_cached_hits, at);
  vec2 weights = uintBitsToFloat(entry.yz);
  return Hit(entry.x, 0.0, vec3(1.0 - weights.x - weights.y, weights), 0.0);
}

bool is_share_cached(ivec2 at) { return imageLoad(u_cached_shares, at).x >= 0.0; }

Share cached_share(ivec2 at) {
  vec4 entry = imageLoad(u_cached_shares, at);
  return Share(entry.x, entry.y, entry.z, entry.w);
}

// Computes and caches the share. The centre must see the prototype.
Share cache_share(ivec2 at, Place place) {
  Share share = share_of(u_projector, place);
  imageStore(u_cached_shares, at, vec4(share.share, share.irradiance, share.missing_black, share.blocked_black));
  return share;
}
