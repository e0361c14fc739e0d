// The light that one sample of a projector's pixel should give. VIEW_PARTS, SURFACE_PARTS: which parts may be
// visible.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "projector_blending.glsl"
#include "finish.glsl"
#include "on_surface.glsl"
#include "balance.glsl"

layout(binding = k_viewer_ids_unit) uniform usampler2DArray s_viewer_ids;
uniform int u_projector;
uniform int u_viewer;  // index of the viewer's viewpoint
uniform int u_placement_count;
#include "hit_cache.glsl"

// Colour of the view part that the viewer sees in front of p; a: 0 when there is none, or when p is hidden
// from the viewer.
vec4 view_colour(vec3 p, vec3 d_normal, float footprint) {
  Viewpoint viewer = viewpoint_at(u_viewer);
  vec3 d = p - viewer.p_origin.xyz;
  float t = length(d);
  d /= t;
  if (dot(d_normal, d) >= 0.0) return vec4(0);  // the viewer sees the other side
  Hit hit = first_hit(s_viewer_ids, viewer, 1, d);
  if (hit.id == 0u || hit.t > t || owner_at(owner_of(hit.id)).upper.w > 0.5) return vec4(0);
  if (is_hidden(s_viewer_ids, viewer, p)) return vec4(0);
  if (is_cap(hit.id)) return vec4(cap_light(hit, viewer.p_origin.xyz, d, footprint), 1);
  return vec4(radiance_along(d, hit, footprint), 1);
}

vec4 surface_colour(Place place, float footprint) {
  if (!may_hold_surface_part(place.p, u_placement_count)) return vec4(0);
  Hit hit = surface_part_at(s_projector_ids, viewpoint_at(u_projector), place.p, place.d_smooth);
  return hit.id == 0u ? vec4(0) : vec4(radiance_on_surface(hit, place.d_smooth, footprint), 1);
}

// The share at a pixel's centre. It is used for all samples of the pixel that hit the same smooth surface;
// the differences within the pixel are small and cancel.
struct CentreShare {
  float t;      // distance along the centre's ray (m); 0: no share
  vec3 d_flat;  // triangle normal of the place there
  Share share;
};

// There is none where the ray hits nothing, where the share is not known, and with even black, whose light
// begins and ends within a pixel.
CentreShare centre_share(ivec2 at) {
  CentreShare none = CentreShare(0.0, vec3(0), Share(0.0, 0.0, 0.0, 0.0));
  Hit prototype = cached_hit(at);
  if (u_even_black || prototype.id == 0u || !is_share_cached(at)) return none;
  Place place = place_at(prototype, ray_of(viewpoint_at(u_projector), vec2(at)));
  return CentreShare(distance(place.p, viewpoint_at(u_projector).p_origin.xyz), place.d_flat, cached_share(at));
}

bool is_same_surface(CentreShare centre, Hit hit, Place place, float footprint) {
  const float k_steepest = 4.0;    // slope: depth divided by width, 76 degrees
  const float k_same_side = 0.99;  // cosine of the angle between triangles, 8 degrees
  return abs(hit.t - centre.t) < k_steepest * footprint && dot(place.d_flat, centre.d_flat) > k_same_side;
}

// The colour that should be visible at a place of the prototype at distance t along the projector's ray; a: 0
// where there is none.
vec4 wanted_colour(Hit prototype, Place place, float t) {
  float footprint = t / viewpoint_at(u_projector).quality.x;
  vec4 colour = vec4(0);
#ifdef VIEW_PARTS
  colour = view_colour(place.p, place.d_flat, footprint);
#endif
#ifdef SURFACE_PARTS
  if (colour.a == 0.0) colour = surface_colour(place, footprint);
#endif
#ifdef FINISH
  if (colour.a == 0.0) {
    vec3 d_viewer = normalize(place.p - viewpoint_at(u_viewer).p_origin.xyz);
    vec3 d = normalize(place.p - viewpoint_at(u_projector).p_origin.xyz);
    vec4 paint = paint_light(prototype, place.p, place.d_flat, d_viewer, d, footprint);
    if (paint.a > 0.0) colour = vec4(paint.rgb, 1);
  }
#endif
  return colour;
}

// One sample of a projector's pixel.
struct Sample {
  Hit prototype;
  Place place;
  vec4 colour;     // result of wanted_colour
  bool gives_light;
  bool uses_centre_share;  // the centre's share can be used
};

Sample sample_at(vec2 px, CentreShare centre) {
  Viewpoint projector = viewpoint_at(u_projector);
  vec3 d = ray_of(projector, px);
  Hit prototype = first_hit(s_projector_ids, projector, 0, d);
  Place place = place_at(prototype, d);
  vec4 colour = wanted_colour(prototype, place, prototype.t);
  bool gives_light = prototype.id != 0u && (colour.a > 0.0 || u_even_black);
  bool uses_centre_share = is_same_surface(centre, prototype, place, prototype.t / projector.quality.x);
  return Sample(prototype, place, colour, gives_light, uses_centre_share);
}

// rgb: light; a: coverage.
vec4 light_of(Sample s, Share share) {
  return vec4(balanced(u_projector, s.colour, share, s.place, s.prototype), 1);
}

// False only if the pixel's centre certainly gives no light: the viewer sees no part there, none lies on the
// surface, and the prototype has neither a finish nor a line there.
bool may_give_light(ivec2 at) {
  Hit prototype = cached_hit(at);
  if (prototype.id == 0u) return false;
  uint first = 3u * (prototype.id - 1u);
  vec3 p = mat3(corner(first).xyz, corner(first + 1u).xyz, corner(first + 2u).xyz) * prototype.weights;
  bool may_give = u_even_black || has_finish();
#ifdef FINISH
  if (!may_give) {
    Viewpoint projector = viewpoint_at(u_projector);
    vec3 d = ray_of(projector, vec2(at));
    Place place = place_at(prototype, d);
    may_give = lines_light(prototype, place.p, place.d_flat, d, prototype.t / projector.quality.x).a > 0.0;
  }
#endif
#ifdef VIEW_PARTS
  vec4 share;
  Viewpoint viewer = viewpoint_at(u_viewer);
  may_give = may_give || ids_around(s_viewer_ids, viewer, 1, p - viewer.p_origin.xyz, share) != uvec4(0);
#endif
#ifdef SURFACE_PARTS
  if (!may_give && may_hold_surface_part(p, u_placement_count)) {
    may_give = may_meet_surface_part(s_projector_ids, viewpoint_at(u_projector), p, smooth_normal_in_owner(prototype));
  }
#endif
  return may_give;
}
