#version 450 core
// A projector's picture: the listed pixels, one sample each at their centres.
#include "light.glsl"
#include "listed.glsl"
layout(local_size_x = 64) in;
layout(rgba32f, binding = 0) uniform writeonly image2D u_picture;

void main() {
  if (gl_GlobalInvocationID.x >= s_list_count) return;
  ivec2 at = listed_pixel(gl_GlobalInvocationID.x);
  imageStore(u_picture, at, centre_light(at));
}
