// Sample positions within a pixel.

uniform int u_samples;  // samples for each pixel: 16, 8 or 4
// No two samples share a row or column, and none is near another.
const int k_rows_of_8[8] = int[](3, 6, 0, 5, 2, 7, 1, 4), k_rows_of_4[4] = int[](1, 3, 0, 2);

// Position of sample k relative to the pixel's centre.
vec2 sample_offset(int k) {
  int row = u_samples == 16 ? 7 * k & 15 : u_samples == 8 ? k_rows_of_8[k & 7] : k_rows_of_4[k & 3];
  return (vec2(k, row) + 0.5) / float(u_samples) - 0.5;
}
