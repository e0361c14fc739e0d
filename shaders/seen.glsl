// What an imager (viewer or camera) sees of the parts at a pixel sample, and whether light can show it.
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
#include "look.glsl"
#include "on_surface.glsl"

uniform usampler2DArray s_eye_ids;
uniform int u_eye;

const int k_nothing = 0, k_screen = 1, k_projected = 2, k_if_reached = 3;

struct Seen {
  int how;
  Hit part;
  vec3 d;
  vec3 p_behind, n_behind;  // the prototype's point behind the part, where `how` is k_if_reached
};

// The part at px that the prototype does not hide. A surface part counts as visible within 2 mm behind the surface.
// k_if_reached: projected if light reaches the prototype there, else left to the screen.
Seen in_sight_at(vec2 px) {
  Sight eye = s_sights[u_eye];
  vec3 d = ray_of(eye, px);
  Seen seen = Seen(k_nothing, first_hit(s_eye_ids, eye, 1, d), d, vec3(0), vec3(0));
  if (seen.part.id == 0u) return seen;
  bool on_surface = s_placements[owner_of(seen.part.id)].upper.w > 0.5;
  Hit prototype = first_hit(s_eye_ids, eye, 0, d);
  if (prototype.id == 0u) {
    seen.how = k_screen;
    return seen;
  }
  vec3 n = flat_normal(prototype.id);
  if (dot(n, d) > 0.0) n = -n;
  float height = (prototype.t - seen.part.t) * -dot(n, d);  // of the part over the surface
  if (height < (on_surface ? -k_on_surface : -k_same_place)) return seen;
  bool shown = !on_surface || height <= k_on_surface;
  seen.how = shown ? k_if_reached : k_screen;
  seen.p_behind = eye.p_eye.xyz + prototype.t * d;
  seen.n_behind = n;
  return seen;
}

Seen seen_at(vec2 px) {
  Seen seen = in_sight_at(px);
  if (seen.how == k_if_reached) seen.how = is_reached(seen.p_behind, seen.n_behind) ? k_projected : k_screen;
  return seen;
}
