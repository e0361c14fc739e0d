// The parts as a camera sees them, in linear light; a: coverage. What projected light cannot show is drawn
// fully, the rest with the part's weight. A contact shadow has coverage but no light.
#include "part_coverage.glsl"
#include "contact.glsl"
// Weights of what projected light can show: one byte for each owner, 255 is all.
uniform uint u_composite_weights[64];

float full_weight(uint owner) {
  return owner < 256u ? float(u_composite_weights[owner / 4u] >> (owner % 4u * 8u) & 255u) / 255.0 : 0.0;
}

vec4 shadow_at(vec3 d) {
  Viewpoint viewer = viewpoint_at(u_viewer);
  Hit prototype = first_hit(s_viewer_ids, viewer, 0, d);
  if (prototype.id == 0u) return vec4(0);
  return vec4(0, 0, 0, contact_shadow(viewer.p_origin.xyz + prototype.t * d, facing_normal(prototype, d)));
}

// The prototype's paint along d where no part is seen, as a part that light shows where it reaches.
// `is_full`: also draws what light can show.
vec4 paint_behind_parts(vec3 d, bool is_full) {
  Viewpoint viewer = viewpoint_at(u_viewer);
  Hit prototype = first_hit(s_viewer_ids, viewer, 0, d);
  if (prototype.id == 0u) return vec4(0);
  float share = is_full ? 1.0 : full_weight(0u);
  Place place = place_at(prototype, d);
  vec3 n = facing_normal(prototype, d);
  vec4 paint = paint_light(prototype, place.p, n, d, d, prototype.t / viewer.quality.x);
  if (paint.a > 0.0 && share < 1.0 && !is_reached(place)) share = 1.0;
  float shadow = k_contact_shadow ? contact_shadow(place.p, n) : 0.0;
  paint = share * paint;
  return vec4((1.0 - shadow) * paint.rgb, paint.a + (1.0 - paint.a) * shadow);
}

// Whether a part or the paint at px must be shown by the screen.
bool is_left_to_screen(vec2 px) {
  VisiblePart visible = visible_part_at(px);
  if (visible.shown_by == k_nothing && is_painted()) {
    Viewpoint viewer = viewpoint_at(u_viewer);
    Hit prototype = first_hit(s_viewer_ids, viewer, 0, visible.d);
    if (prototype.id == 0u) return false;
    Place place = place_at(prototype, visible.d);
    return paint_light(prototype, place.p, facing_normal(prototype, visible.d), visible.d, visible.d,
                       prototype.t / viewer.quality.x).a > 0.0 && !is_reached(place);
  }
  return visible.shown_by == k_screen || (visible.shown_by == k_if_reached && !is_reached(visible.behind));
}

// `is_full`: also draws what light can show.
vec4 composite_light(VisiblePart visible, bool is_full) {
  if (visible.shown_by == k_nothing && is_painted()) return paint_behind_parts(visible.d, is_full);
  if (visible.shown_by == k_nothing) return k_contact_shadow ? shadow_at(visible.d) : vec4(0);
  float share = visible.shown_by == k_if_reached && !is_full ? full_weight(owner_of(visible.part.id)) : 1.0;
  if (share < 1.0 && !is_reached(visible.behind)) share = 1.0;
  if (share == 0.0) return vec4(0);
  float footprint = visible.part.t / viewpoint_at(u_viewer).quality.x;
  if (is_cap(visible.part.id))
    return share * vec4(cap_light(visible.part, viewpoint_at(u_viewer).p_origin.xyz, visible.d, footprint), 1);
  if (owner_at(owner_of(visible.part.id)).upper.w > 0.5) {  // shaded as the projectors show it
    return share * vec4(radiance_on_surface(visible.part, smooth_normal(visible.part), footprint), 1);
  }
  return share * vec4(radiance_along(visible.d, visible.part, footprint), 1);
}
