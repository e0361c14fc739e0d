// Which part an imager (viewer or camera) sees at a pixel sample, and whether projected light can show it.
#include "bindings.glsl"
#include "scene.glsl"
#include "lens.glsl"
#include "reach.glsl"
#include "look.glsl"
#include "on_surface.glsl"

layout(binding = k_eye_ids_unit) uniform usampler2DArray s_eye_ids;
uniform int u_eye;

const int k_nothing = 0, k_screen = 1, k_projected = 2, k_if_reached = 3;

struct Seen {
  int how;
  Hit part;
  vec3 d;
  Place behind;  // the prototype's place behind the part, if `how` is k_if_reached
};

// The part at px, unless the prototype hides it. A surface part counts as visible up to 2 mm behind the
// surface. k_if_reached: projected if light reaches the prototype there, else left to the screen.
Seen in_sight_at(vec2 px) {
  Sight eye = sight_at(u_eye);
  vec3 d = ray_of(eye, px);
  Seen seen = Seen(k_nothing, first_hit(s_eye_ids, eye, 1, d), d, Place(vec3(0), vec3(0), vec3(0)));
  if (seen.part.id == 0u) return seen;
  bool on_surface = owner_at(owner_of(seen.part.id)).upper.w > 0.5;
  Hit prototype = first_hit(s_eye_ids, eye, 0, d);
  if (prototype.id == 0u) {
    seen.how = k_screen;
    return seen;
  }
  Place behind = place_at(prototype, d);
  // Height of the part above the surface.
  float height = (prototype.t - seen.part.t) * -dot(behind.d_flat, d);
  if (height < (on_surface ? -k_on_surface : -k_same_place)) return seen;
  bool shown = !on_surface || height <= k_on_surface;
  seen.how = shown ? k_if_reached : k_screen;
  seen.behind = behind;
  return seen;
}

Seen seen_at(vec2 px) {
  Seen seen = in_sight_at(px);
  if (seen.how == k_if_reached) seen.how = is_reached(seen.behind) ? k_projected : k_screen;
  return seen;
}
