// Finds surface parts on the prototype, along the prototype's normal.

const float k_on_surface = 0.002;  // m; a surface part is on the prototype if it is within this distance

bool may_hold_surface_part(vec3 p, int placement_count) {
  int i = 1;
  bool may_hold = false;
  do {
    Owner owner = owner_at(i);
    vec3 q = (owner.owner_from_scene * vec4(p, 1)).xyz;
    may_hold = owner.lower.w > 0.5 && owner.upper.w > 0.5 && all(greaterThan(q, owner.lower.xyz - k_on_surface)) &&
               all(lessThan(q, owner.upper.xyz + k_on_surface));
  } while (!may_hold && ++i < placement_count);
  return may_hold;
}

// Steps along the normal, to each side, so that the line from -k_on_surface to k_on_surface moves by at most a
// pixel of the id image at each: none where it is seen from its end, several where it is seen from the side.
int steps_along_normal(Viewpoint viewpoint, vec3 p, vec3 d_normal) {
  const float k_most_steps = 8.0;
  vec3 d = mat3(viewpoint.pinhole_from_scene) * (p - viewpoint.p_origin.xyz);
  vec3 n = k_on_surface * (mat3(viewpoint.pinhole_from_scene) * d_normal);
  vec2 px = viewpoint.focal_centre.xy * (n.xy - n.z * d.xy / d.z) / d.z;
  return int(clamp(ceil(length(px) - 0.25), 0.0, k_most_steps));
}

// A point of the line along the normal that is searched, relative to the viewpoint: at heights 0, 1, -1, 2, -2
// and so on, in steps.
vec3 along_normal(Viewpoint viewpoint, vec3 p, vec3 d_normal, int height, int steps) {
  float along = float((height + 1) / 2) * (height % 2 == 1 ? 1.0 : -1.0) / float(max(steps, 1));
  return p + along * k_on_surface * d_normal - viewpoint.p_origin.xyz;
}

// Whether the projector's id image shows any part around the line along the normal. If not, surface_part_at
// finds none.
bool may_meet_surface_part(usampler2DArray s_ids, Viewpoint viewpoint, vec3 p, vec3 d_normal) {
  int steps = steps_along_normal(viewpoint, p, d_normal), height = 0;
  bool may_meet = false;
  do {
    vec4 share;
    may_meet = ids_around(s_ids, viewpoint, 1, along_normal(viewpoint, p, d_normal, height, steps), share) != uvec4(0);
  } while (!may_meet && ++height <= 2 * steps);
  return may_meet;
}

// Whether a part covers the point p of the plane of a triangle that is thinner than a texel, as first_hit has
// it.
bool is_covered_by_thin(usampler2DArray s_ids, Viewpoint viewpoint, Hit missed, vec3 p) {
  vec3 d = p - viewpoint.p_origin.xyz;
  float t = length(d);
  vec4 share;
  uvec4 ids = ids_around(s_ids, viewpoint, 1, d, share);
  return dot(share, vec4(notEqual(ids, uvec4(0)))) >= 0.5 &&
         is_thin(missed.id, t, turned_to_owner(owner_of(missed.id), d / t), viewpoint);
}

// The surface part at the prototype's point p with unit normal d_normal: the nearest intersection of the
// normal line with a triangle within 2 mm. Only triangles in the projector's id image around the line are
// tested. In the middle of a part, where many triangles meet in a corner, rounding may miss all of them, and
// triangles thinner than a texel may be in no texel; then the one missed by least is used.
Hit surface_part_at(usampler2DArray s_ids, Viewpoint viewpoint, vec3 p, vec3 d_normal) {
  int steps = steps_along_normal(viewpoint, p, d_normal);
  Hit best = k_no_hit, missed = k_no_hit;
  float missed_by = 2.0;  // as a fraction of a triangle's height
  bool in_middle = false, is_through = false;  // hit a piece below the alpha cutoff
  uvec4 tried = uvec4(0);
  int height = 0;
  do {
    vec4 share;
    vec3 d = along_normal(viewpoint, p, d_normal, height, steps);
    uvec4 ids = ids_around(s_ids, viewpoint, 1, d, share);
    if (height == 0) in_middle = all(notEqual(ids, uvec4(0)));
    for (int k = 0; k < 4; ++k)
      if (any(equal(tried, uvec4(ids[k])))) ids[k] = 0u;
    uvec4 left = each_once(ids);
    tried = left.y == 0u ? uvec4(left.x, tried.xyz) : left.z == 0u ? uvec4(left.xy, tried.xy) : left;
    if (left.x == 0u) continue;
    do {
      uint id = left.x;
      left = uvec4(left.yzw, 0u);
      Hit hit;
      if (owner_at(owner_of(id)).upper.w < 0.5 || !plane_hit(id, p, d_normal, hit) || abs(hit.t) > k_on_surface) continue;
      if (is_removed(id, p + hit.t * d_normal)) continue;
      float outside = -min(hit.weights.x, min(hit.weights.y, hit.weights.z));
      if (outside > hit.slack) {
        if (outside < missed_by) {
          missed = hit;
          missed_by = outside;
        }
      } else if (is_cut_out(hit, distance(p, viewpoint.p_origin.xyz) / viewpoint.focal_centre.x)) {
        is_through = true;
      } else if (abs(hit.t) < abs(best.t)) {
        best = hit;
      }
    } while (left.x != 0u);
  } while (best.id == 0u && ++height <= 2 * steps);
  if (best.id == 0u && missed.id != 0u && !is_through &&
      (in_middle && missed_by < 0.5 || is_covered_by_thin(s_ids, viewpoint, missed, p + missed.t * d_normal)))
    best = missed;
  return best;
}
