// What a projector's pixel centres see of the prototype and its share there, kept from image to image while the
// prototype stays and light arrives as it did.
#include "bindings.glsl"

// Id, bits of two weights, u_known_stamp of its time.
layout(rgba32ui, binding = k_cached_hits_image) uniform uimage2D u_known_hits;
// A Share; x: negative where unknown yet.
layout(rgba32f, binding = k_cached_shares_image) uniform image2D u_known_shares;
uniform uint u_known_stamp;

bool is_hit_known(ivec2 at) { return imageLoad(u_known_hits, at).w == u_known_stamp; }

// Finds out what the centre sees. The share there is not known then.
void learn_hit(ivec2 at) {
  Sight projector = sight_at(u_projector);
  Hit hit = first_hit(s_projector_ids, projector, 0, ray_of(projector, vec2(at)));
  imageStore(u_known_hits, at, uvec4(hit.id, floatBitsToUint(hit.weights.yz), u_known_stamp));
  imageStore(u_known_shares, at, vec4(-1));
}

// Where that has been found out.
Hit known_hit(ivec2 at) {
  uvec4 known = imageLoad(u_known_hits, at);
  vec2 weights = uintBitsToFloat(known.yz);
  return Hit(known.x, 0.0, vec3(1.0 - weights.x - weights.y, weights), 0.0);
}

bool is_share_known(ivec2 at) { return imageLoad(u_known_shares, at).x >= 0.0; }

Share known_share(ivec2 at) {
  vec4 known = imageLoad(u_known_shares, at);
  return Share(known.x, known.y, known.z, known.w);
}

// Where the centre sees something.
Share learn_share(ivec2 at, Place place) {
  Share share = share_of(u_projector, place);
  imageStore(u_known_shares, at, vec4(share.share, share.irradiance, share.missing_black, share.blocked_black));
  return share;
}
