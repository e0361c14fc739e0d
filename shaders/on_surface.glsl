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

// The surface part at the prototype's point p with unit normal d_normal: the nearest intersection of the
// normal line with a triangle within 2 mm. Only triangles in the projector's id image around the line are
// tested. In the middle of a part, where many triangles meet in a corner, rounding may miss all of them; then
// the one missed by least is used.
Hit surface_part_at(usampler2DArray s_ids, Viewpoint viewpoint, vec3 p, vec3 d_normal) {
  const float k_heights[5] = float[](0.0, 0.5, -0.5, 1.0, -1.0);
  Hit best = k_no_hit, missed = k_no_hit;
  float missed_by = 0.5;  // as a fraction of a triangle's height
  bool in_middle = false, is_through = false;  // hit a piece below the alpha cutoff
  uvec4 tried = uvec4(0);
  int height = 0;
  do {
    vec4 share;
    vec3 d = p + k_heights[height] * k_on_surface * d_normal - viewpoint.p_origin.xyz;
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
  } while (best.id == 0u && ++height < 5);
  if (best.id == 0u && in_middle && !is_through) best = missed;
  return best;
}
