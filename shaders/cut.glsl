// What a plane cuts open, and the caps that close the openings. Compiled only if SECTION is defined, because software
// GL would execute the code even if nothing is cut. A cap has an id of its own: k_first_cap plus its owner.
#include "bindings.glsl"

#ifdef SECTION
uniform vec4 u_cut;              // height of p over the plane, scene frame: dot(xyz, p) + w; removed where it is positive
uniform vec4 u_prototype_hatch;  // as Owner.hatch; of this drawing
uniform vec3 u_cap_colour;       // linear light
uniform vec2 u_hatch;            // width of a line as a share of their distance; its colour as a share of the cap's

const uint k_first_cap = 0x80000000u;
// As k_cut_margin_m of scene/meshes/closed_pieces.h.
const float k_cut_margin = 1e-5;

bool is_cap(uint id) { return id >= k_first_cap; }
float height_over_cut(vec3 p) { return dot(u_cut.xyz, p) + u_cut.w; }
#else
bool is_cap(uint id) { return false; }
#endif
